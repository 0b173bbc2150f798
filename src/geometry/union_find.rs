//! Which of many things belong together.

/// Disjoint sets of `0..count`; the smallest member stands for its set.
#[derive(Debug, Clone)]
pub struct UnionFind {
    parent: Vec<u32>,
}

impl UnionFind {
    /// Every member alone.
    pub fn new(count: usize) -> Self {
        Self { parent: (0..count as u32).collect() }
    }

    /// The smallest member of the set of `index`.
    pub fn root(&mut self, index: usize) -> usize {
        let mut index = index as u32;
        while self.parent[index as usize] != index {
            // Path halving (Tarjan and van Leeuwen 1984).
            let next = self.parent[self.parent[index as usize] as usize];
            self.parent[index as usize] = next;
            index = next;
        }
        index as usize
    }

    /// Joins the sets of two members.
    pub fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.root(a), self.root(b));
        self.parent[a.max(b)] = a.min(b) as u32;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_smallest_member_stands_for_its_set() {
        let mut sets = UnionFind::new(7);
        for (a, b) in [(6, 5), (5, 2), (4, 1), (1, 4), (3, 3)] {
            sets.join(a, b);
        }
        assert_eq!([0, 1, 2, 3, 4, 5, 6].map(|index| sets.root(index)), [0, 1, 2, 3, 1, 2, 2]);
    }
}
