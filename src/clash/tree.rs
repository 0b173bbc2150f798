//! A bounding-volume tree of the part's triangles whose boxes are tight along the closing axis.
//!
//! The bodies of a gripper turn about the closing axis only, and pads lie on faces perpendicular to
//! it. Boxes in axes that follow the closing axis make both exact and cheap: a face under a pad has
//! a box without height, however finely it is triangulated, and a turned body meets a box by five
//! separating axes instead of fifteen. The tree's shape is built once per part; per closing
//! direction only vertices and boxes are computed anew.

use std::sync::Arc;

use glam::{DMat3, DVec3, Vec3A};
use rayon::prelude::*;

use crate::part::Mesh;

/// Triangles per leaf, at most.
const LEAF: usize = 4;
/// Subtrees smaller than this are built by one thread.
const SERIAL: usize = 8192;

/// One node: the triangles `first..first + count` in tree order. Nodes lie in depth-first order:
/// the left child of an inner node follows it.
#[derive(Debug, Clone, Copy, Default)]
struct Node {
    first: u32,
    count: u32,
    /// Index of the right child; zero for a leaf.
    right: u32,
}

/// The shape of the tree, independent of axes.
#[derive(Debug)]
pub(crate) struct Topology {
    nodes: Vec<Node>,
    /// Corners of the triangles in tree order, as indices into `vertices`.
    corners: Vec<[u32; 3]>,
    /// Mesh index of the triangles in tree order.
    order: Vec<u32>,
    /// Vertices in the part frame, in the order in which the triangles need them first: neighbours
    /// in the tree are neighbours in memory.
    vertices: Vec<DVec3>,
}

impl Topology {
    pub(crate) fn new(mesh: &Mesh) -> Self {
        let centroids: Vec<[f32; 3]> = mesh
            .triangles
            .par_iter()
            .map(|triangle| {
                let sum: DVec3 =
                    triangle.iter().map(|&vertex| mesh.vertices[vertex as usize]).sum();
                (sum / 3.0).as_vec3().to_array()
            })
            .collect();
        let mut order: Vec<u32> = (0..mesh.triangles.len() as u32).collect();
        let mut nodes =
            vec![Node::default(); if order.is_empty() { 0 } else { 2 * leaves(order.len()) - 1 }];
        if !order.is_empty() {
            build(&mut nodes, 0, &mut order, 0, &centroids);
        }
        let mut number = vec![u32::MAX; mesh.vertices.len()];
        let mut vertices = Vec::with_capacity(mesh.vertices.len());
        let mut renumbered = |vertex: u32| {
            let slot = &mut number[vertex as usize];
            if *slot == u32::MAX {
                *slot = vertices.len() as u32;
                vertices.push(mesh.vertices[vertex as usize]);
            }
            *slot
        };
        let corners = order
            .iter()
            .map(|&triangle| mesh.triangles[triangle as usize].map(&mut renumbered))
            .collect();
        Self { nodes, corners, order, vertices }
    }
}

fn leaves(count: usize) -> usize {
    if count <= LEAF { 1 } else { leaves(count / 2) + leaves(count - count / 2) }
}

/// Splits `order` at the median along its longest extent; `nodes` holds exactly the nodes of this
/// subtree, the first of which has the index `base`.
fn build(nodes: &mut [Node], base: usize, order: &mut [u32], first: usize, centroids: &[[f32; 3]]) {
    nodes[0] = Node { first: first as u32, count: order.len() as u32, right: 0 };
    if order.len() <= LEAF {
        return;
    }
    let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for &triangle in order.iter() {
        let centroid = centroids[triangle as usize];
        for axis in 0..3 {
            low[axis] = low[axis].min(centroid[axis]);
            high[axis] = high[axis].max(centroid[axis]);
        }
    }
    let axis =
        (0..3).max_by(|&a, &b| (high[a] - low[a]).total_cmp(&(high[b] - low[b]))).unwrap_or(0);
    let half = order.len() / 2;
    // The index breaks ties, so that the tree is the same on every run.
    order.select_nth_unstable_by(half, |&a, &b| {
        centroids[a as usize][axis].total_cmp(&centroids[b as usize][axis]).then(a.cmp(&b))
    });
    let (left, right) = order.split_at_mut(half);
    let split = 1 + 2 * leaves(half) - 1;
    nodes[0].right = (base + split) as u32;
    let (left_nodes, right_nodes) = nodes.split_at_mut(split);
    let build_left =
        |left: &mut [u32]| build(&mut left_nodes[1..], base + 1, left, first, centroids);
    let build_right =
        |right: &mut [u32]| build(right_nodes, base + split, right, first + half, centroids);
    if left.len() < SERIAL {
        let (mut build_left, mut build_right) = (build_left, build_right);
        build_left(left);
        build_right(right);
    } else {
        let (mut build_left, mut build_right) = (build_left, build_right);
        rayon::join(|| build_left(left), || build_right(right));
    }
}

/// The tree in the axes of one closing direction.
#[derive(Debug)]
pub(crate) struct Tree {
    shape: Arc<Topology>,
    axes_from_part: DMat3,
    /// Smallest and largest coordinates of each node, grown by the rounding to 32 bits.
    boxes: Vec<[[f32; 3]; 2]>,
}

impl Tree {
    /// `axes_from_part` turns part coordinates into those of the tree.
    pub(crate) fn new(shape: &Arc<Topology>, axes_from_part: DMat3) -> Self {
        let points: Vec<Vec3A> =
            shape.vertices.par_iter().map(|&vertex| (axes_from_part * vertex).as_vec3a()).collect();
        let reach = shape
            .vertices
            .par_iter()
            .map(|vertex| vertex.length_squared())
            .reduce(|| 0.0, f64::max)
            .sqrt();
        // Rounding a coordinate moves it by at most 2^-24 of its size, growing the box rounds
        // again.
        let slack = Vec3A::splat((reach * f64::from(f32::EPSILON)) as f32);
        let leaf = |node: &Node| {
            let (mut low, mut high) = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
            for triangle in &shape.corners[node.first as usize..(node.first + node.count) as usize]
            {
                for &vertex in triangle {
                    let point = points[vertex as usize];
                    (low, high) = (low.min(point), high.max(point));
                }
            }
            [(low - slack).to_array(), (high + slack).to_array()]
        };
        let mut boxes: Vec<[[f32; 3]; 2]> = shape
            .nodes
            .par_iter()
            .map(|node| if node.right == 0 { leaf(node) } else { [[0.0; 3]; 2] })
            .collect();
        for index in (0..shape.nodes.len()).rev() {
            let right = shape.nodes[index].right as usize;
            if right != 0 {
                let ([low_a, high_a], [low_b, high_b]) = (boxes[index + 1], boxes[right]);
                let low = Vec3A::from_array(low_a).min(Vec3A::from_array(low_b));
                let high = Vec3A::from_array(high_a).max(Vec3A::from_array(high_b));
                boxes[index] = [low.to_array(), high.to_array()];
            }
        }
        Self { shape: Arc::clone(shape), axes_from_part, boxes }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.shape.nodes.is_empty()
    }

    /// Children of an inner node; `None` for a leaf.
    #[inline]
    pub(crate) fn children(&self, node: u32) -> Option<[u32; 2]> {
        let right = self.shape.nodes[node as usize].right;
        (right != 0).then_some([node + 1, right])
    }

    /// Middle and half sizes of a node's box.
    #[inline]
    pub(crate) fn bounds(&self, node: u32) -> (DVec3, DVec3) {
        let [a, b] = &self.boxes[node as usize];
        let low = DVec3::new(f64::from(a[0]), f64::from(a[1]), f64::from(a[2]));
        let high = DVec3::new(f64::from(b[0]), f64::from(b[1]), f64::from(b[2]));
        ((low + high) / 2.0, (high - low) / 2.0)
    }

    /// A vertex of some triangle under the node.
    #[inline]
    pub(crate) fn witness(&self, node: u32) -> DVec3 {
        self.vertex(self.shape.corners[self.shape.nodes[node as usize].first as usize][0])
    }

    /// Triangles under a node: mesh index and corners.
    pub(crate) fn triangles(&self, node: u32) -> impl Iterator<Item = (u32, [DVec3; 3])> + '_ {
        let node = self.shape.nodes[node as usize];
        (node.first as usize..(node.first + node.count) as usize).map(|index| {
            let [a, b, c] = self.shape.corners[index];
            (self.shape.order[index], [self.vertex(a), self.vertex(b), self.vertex(c)])
        })
    }

    /// Smallest and largest coordinates of a node's box.
    pub(crate) fn corners(&self, node: u32) -> [Vec3A; 2] {
        self.boxes[node as usize].map(Vec3A::from_array)
    }

    /// Number of triangles.
    pub(crate) fn len(&self) -> usize {
        self.shape.corners.len()
    }

    /// Corners of the triangle at this place in the tree's order.
    pub(crate) fn triangle(&self, place: u32) -> [DVec3; 3] {
        let [a, b, c] = self.shape.corners[place as usize];
        [self.vertex(a), self.vertex(b), self.vertex(c)]
    }

    #[inline]
    fn vertex(&self, vertex: u32) -> DVec3 {
        self.axes_from_part * self.shape.vertices[vertex as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_triangle_lies_in_the_boxes_above_it() {
        let count = 1000_u32;
        let vertices: Vec<DVec3> = (0..3 * count)
            .map(|k| {
                DVec3::new(
                    (f64::from(k) * 0.7).sin(),
                    (f64::from(k) * 1.3).cos(),
                    f64::from(k % 17),
                )
            })
            .collect();
        let triangles: Vec<[u32; 3]> = (0..count).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
        let mesh = Mesh { vertices, triangles };
        let shape = Arc::new(Topology::new(&mesh));
        let tree = Tree::new(&shape, DMat3::from_rotation_y(0.4));
        let mut found = vec![false; count as usize];
        let mut stack = vec![0];
        while let Some(node) = stack.pop() {
            let (middle, half) = tree.bounds(node);
            for (index, corners) in tree.triangles(node) {
                assert!(
                    corners.iter().all(|corner| (*corner - middle).abs().cmple(half + 1e-12).all())
                );
                if tree.children(node).is_none() {
                    assert!(!std::mem::replace(&mut found[index as usize], true));
                }
            }
            stack.extend(tree.children(node).into_iter().flatten());
        }
        assert!(found.iter().all(|&found| found));
        assert!(Tree::new(&Arc::new(Topology::new(&Mesh::default())), DMat3::IDENTITY).is_empty());
    }
}
