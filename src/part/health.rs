//! What was wrong with a mesh, what was repaired, and what is left.

use glam::DVec3;
use serde::Serialize;

/// Findings and repairs, in the order in which they are made.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Health {
    /// Triangles in the file.
    pub triangles_read: usize,
    /// Triangles without area that were removed.
    pub degenerate_removed: usize,
    /// Second and further copies of triangles that were removed.
    pub duplicates_removed: usize,
    /// Vertices joined with a near one to close cracks.
    pub vertices_joined: usize,
    /// Edges cut where a vertex of a neighbour lies on them (T-junctions).
    pub edges_split: usize,
    /// Triangles whose winding disagreed with their neighbours and was reversed.
    pub windings_reversed: usize,
    /// Shells that were inside out as a whole and were reversed.
    pub shells_reversed: usize,
    /// Connected surfaces.
    pub shells: usize,
    /// Shells that bound a hollow inside of another.
    pub voids: usize,
    /// Shells of material wholly inside another shell's material; they count neither for volume nor
    /// for grips.
    pub embedded: usize,
    /// Edges left with a triangle on one side only.
    pub open_edges: usize,
    /// Middle of the longest open edge \[m\].
    pub open_edge_at: Option<DVec3>,
    /// Edges that more than two triangles share.
    pub tangled_edges: usize,
    /// Middle of the longest such edge \[m\].
    pub tangled_edge_at: Option<DVec3>,
    /// Edges at which no choice of windings agrees (a one-sided surface).
    pub one_sided_edges: usize,
    /// Pairs of shells that pass through each other: their common volume is counted twice.
    pub crossing_shells: usize,
    /// Where two of them do \[m\].
    pub crossing_at: Option<DVec3>,
    /// The surface bounds material everywhere: no open edge, windings agree. Otherwise mass
    /// properties are estimates.
    pub watertight: bool,
    /// Things a user should look at, in words.
    pub warnings: Vec<String>,
}

impl Health {
    /// The findings in words, one line each, lengths in millimetres. Clean meshes give one line.
    pub fn lines(&self) -> Vec<String> {
        let mut lines = Vec::new();
        let place = |at: Option<DVec3>| {
            at.map_or(String::new(), |at| {
                format!(
                    " (the longest at {:.3}, {:.3}, {:.3} mm)",
                    at.x * 1e3,
                    at.y * 1e3,
                    at.z * 1e3
                )
            })
        };
        lines.push(if self.watertight {
            "watertight".to_string()
        } else {
            "NOT watertight: volume and centre of mass are estimates".to_string()
        });
        let mut add = |count: usize, one: &str, many: &str, rest: String| {
            if count > 0 {
                lines.push(format!("{count} {}{rest}", if count == 1 { one } else { many }));
            }
        };
        add(self.open_edges, "open edge", "open edges", place(self.open_edge_at));
        add(
            self.tangled_edges,
            "edge shared by more than two triangles",
            "edges shared by more than two triangles",
            place(self.tangled_edge_at),
        );
        add(
            self.one_sided_edges,
            "edge at which windings cannot agree",
            "edges at which windings cannot agree",
            String::new(),
        );
        add(
            self.degenerate_removed,
            "triangle without area removed",
            "triangles without area removed",
            String::new(),
        );
        add(
            self.duplicates_removed,
            "duplicate triangle removed",
            "duplicate triangles removed",
            String::new(),
        );
        add(
            self.vertices_joined,
            "vertex joined to close cracks",
            "vertices joined to close cracks",
            String::new(),
        );
        add(
            self.edges_split,
            "edge cut at a T-junction",
            "edges cut at T-junctions",
            String::new(),
        );
        add(
            self.windings_reversed,
            "triangle winding reversed",
            "triangle windings reversed",
            String::new(),
        );
        add(
            self.shells_reversed,
            "inside-out shell reversed",
            "inside-out shells reversed",
            String::new(),
        );
        if self.shells > 1 {
            lines.push(format!(
                "{} shells, of which {} hollow, {} inside the material of another",
                self.shells, self.voids, self.embedded
            ));
        }
        if let Some(at) = self.crossing_at {
            let at = at * 1e3;
            lines.push(format!(
                "{} pairs of shells pass through each other (one at {:.3}, {:.3}, {:.3} mm): unite them in the CAD system; volume is counted twice there",
                self.crossing_shells, at.x, at.y, at.z
            ));
        }
        lines.extend(self.warnings.iter().cloned());
        lines
    }
}
