//! Shells (connected surfaces): one winding in each, outward for bodies, and which shell lies
//! inside which.

use glam::DVec3;
use robust::{Coord, orient2d};

use super::mass::{self, Integrals};
use super::topology::{Edges, NONE, ends};
use super::{Health, Mesh};

/// What a shell bounds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Role {
    /// Material, reachable from outside.
    Body,
    /// Material in a hollow of another body.
    Enclosed,
    /// A hollow in a body.
    Void,
    /// Nothing of its own: it lies in the material of another shell.
    Embedded,
}

/// A connected surface.
#[derive(Debug, Clone)]
pub(super) struct Shell {
    pub role: Role,
    /// Volume integrals about the apex given to [`orient`].
    pub integrals: Integrals,
    /// Bounding box \[m\].
    pub low: DVec3,
    pub high: DVec3,
}

/// What is known of a shell before its sense is.
struct Draft {
    low: DVec3,
    high: DVec3,
    triangles: usize,
    /// Half-edges without a neighbour.
    loose: usize,
}

/// Labels the shells, makes their windings agree and turns them outward (hollows: out of the
/// material, inward). Returns the shell of every triangle and the shells. Where anything was
/// reversed `edges` must be found again.
pub(super) fn orient(
    mesh: &mut Mesh,
    edges: &Edges,
    apex: DVec3,
    health: &mut Health,
) -> (Vec<u32>, Vec<Shell>) {
    let (shell_of, reversed, count) = label(mesh, edges, health);
    reverse_minority(mesh, &shell_of, &reversed, count, health);
    let mut drafts: Vec<Draft> = (0..count)
        .map(|_| Draft { low: DVec3::INFINITY, high: DVec3::NEG_INFINITY, triangles: 0, loose: 0 })
        .collect();
    for (triangle, &shell) in shell_of.iter().enumerate() {
        let draft = &mut drafts[shell as usize];
        draft.triangles += 1;
        for corner in mesh.corners(triangle as u32) {
            draft.low = draft.low.min(corner);
            draft.high = draft.high.max(corner);
        }
    }
    for &half in edges.open.iter().chain(&edges.unpaired) {
        drafts[shell_of[(half / 3) as usize] as usize].loose += 1;
    }
    let members = Members::new(&shell_of, drafts.len());
    let mut shells: Vec<Shell> = (0..drafts.len())
        .map(|shell| Shell {
            role: Role::Body,
            integrals: mass::integrate(mesh, members.of(shell), apex),
            low: drafts[shell].low,
            high: drafts[shell].high,
        })
        .collect();
    let inside_out: Vec<bool> = (0..drafts.len())
        .map(|shell| signed_volume(mesh, &members, &drafts[shell], &shells[shell], shell) < 0.0)
        .collect();
    assign_roles(mesh, &members, &drafts, &inside_out, &mut shells);
    let mut reverse = vec![false; shells.len()];
    for (index, shell) in shells.iter().enumerate() {
        // Normals point out of the material, so the skin of a hollow has a negative volume.
        reverse[index] = inside_out[index] != (shell.role == Role::Void);
        match shell.role {
            Role::Void => health.voids += 1,
            Role::Embedded => health.embedded += 1,
            Role::Body | Role::Enclosed => {}
        }
    }
    if reverse.contains(&true) {
        for (triangle, &shell) in mesh.triangles.iter_mut().zip(&shell_of) {
            if reverse[shell as usize] {
                triangle.swap(1, 2);
            }
        }
        for (shell, _) in shells.iter_mut().zip(&reverse).filter(|(_, reverse)| **reverse) {
            shell.integrals.negate();
            health.shells_reversed += 1;
        }
    }
    health.shells = shells.len();
    (shell_of, shells)
}

/// Boxes and integrals of shells whose vertices have moved.
pub(super) fn measure(mesh: &Mesh, shell_of: &[u32], shells: &mut [Shell], apex: DVec3) {
    let members = Members::new(shell_of, shells.len());
    for (index, shell) in shells.iter_mut().enumerate() {
        shell.integrals = mass::integrate(mesh, members.of(index), apex);
        (shell.low, shell.high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for corner in members.of(index).flat_map(|triangle| mesh.corners(triangle)) {
            (shell.low, shell.high) = (shell.low.min(corner), shell.high.max(corner));
        }
    }
}

/// Walks over the neighbours: the shell of each triangle, whether its winding disagrees with that
/// of its shell's first triangle (empty when none does), and the number of shells.
fn label(mesh: &Mesh, edges: &Edges, health: &mut Health) -> (Vec<u32>, Vec<bool>, usize) {
    let count = mesh.triangles.len();
    let disagree =
        |half: u32, twin: u32| ends(&mesh.triangles, half).0 == ends(&mesh.triangles, twin).0;
    let consistent = (0..3 * count as u32).all(|half| {
        let twin = edges.twin[half as usize];
        twin == NONE || twin < half || !disagree(half, twin)
    });
    let mut shell_of = vec![NONE; count];
    let mut reversed = vec![false; if consistent { 0 } else { count }];
    let mut shells = 0;
    let mut stack = Vec::new();
    for seed in 0..count as u32 {
        if shell_of[seed as usize] != NONE {
            continue;
        }
        shell_of[seed as usize] = shells;
        stack.push(seed);
        while let Some(triangle) = stack.pop() {
            for half in triangle * 3..triangle * 3 + 3 {
                let twin = edges.twin[half as usize];
                if twin == NONE {
                    continue;
                }
                let other = (twin / 3) as usize;
                let wanted = !consistent && (reversed[triangle as usize] ^ disagree(half, twin));
                if shell_of[other] == NONE {
                    shell_of[other] = shells;
                    if wanted {
                        reversed[other] = true;
                    }
                    stack.push(other as u32);
                } else if !consistent && reversed[other] != wanted && half < twin {
                    health.one_sided_edges += 1;
                }
            }
        }
        shells += 1;
    }
    (shell_of, reversed, shells as usize)
}

/// Makes the windings of each shell agree: that of most of its area is taken for the file's.
fn reverse_minority(
    mesh: &mut Mesh,
    shell_of: &[u32],
    reversed: &[bool],
    shells: usize,
    health: &mut Health,
) {
    if reversed.is_empty() {
        return;
    }
    let mut balance = vec![0.0; shells]; // area that keeps its winding minus area that does not
    for (triangle, &shell) in shell_of.iter().enumerate() {
        let [a, b, c] = mesh.corners(triangle as u32);
        let area = (b - a).cross(c - a).length();
        balance[shell as usize] += if reversed[triangle] { -area } else { area };
    }
    for (index, triangle) in mesh.triangles.iter_mut().enumerate() {
        if reversed[index] ^ (balance[shell_of[index] as usize] < 0.0) {
            triangle.swap(1, 2);
            health.windings_reversed += 1;
        }
    }
}

/// Volume whose sign tells the sense of a shell. An open one has no volume of its own: about the
/// middle of its box the sign is right for whatever is nearly a body; a nearly flat one keeps the
/// file's winding.
fn signed_volume(
    mesh: &Mesh,
    members: &Members,
    draft: &Draft,
    shell: &Shell,
    index: usize,
) -> f64 {
    if draft.loose == 0 {
        return shell.integrals.volume();
    }
    if draft.loose > draft.triangles {
        return 0.0; // fragments: a closed surface has three half-edges with a neighbour per triangle
    }
    let size = draft.high - draft.low;
    let volume = mass::integrate(mesh, members.of(index), (draft.low + draft.high) / 2.0).volume();
    // 1e-3 of the box: below it the surface is a sheet, not the skin of a body.
    if volume.abs() > 1e-3 * size.x * size.y * size.z { volume } else { 0.0 }
}

/// The points of some triangles that lie farthest along the axes and the diagonals of space. They
/// depend on the surface, not on the order of its triangles.
fn extremes(mesh: &Mesh, triangles: impl Iterator<Item = u32>) -> [DVec3; 14] {
    const ALONG: [[f64; 3]; 14] = [
        [1.0, 0.0, 0.0],
        [-1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, -1.0, 0.0],
        [0.0, 0.0, 1.0],
        [0.0, 0.0, -1.0],
        [1.0, 1.0, 1.0],
        [-1.0, 1.0, 1.0],
        [1.0, -1.0, 1.0],
        [1.0, 1.0, -1.0],
        [-1.0, -1.0, 1.0],
        [-1.0, 1.0, -1.0],
        [1.0, -1.0, -1.0],
        [-1.0, -1.0, -1.0],
    ];
    let mut found = [(f64::NEG_INFINITY, DVec3::ZERO); 14];
    for corner in triangles.flat_map(|triangle| mesh.corners(triangle)) {
        for (along, (most, at)) in ALONG.iter().zip(&mut found) {
            let value = DVec3::from_array(*along).dot(corner);
            let earlier =
                || corner.to_array().partial_cmp(&at.to_array()).is_some_and(|o| o.is_lt());
            if value > *most || (value == *most && earlier()) {
                (*most, *at) = (value, corner);
            }
        }
    }
    found.map(|(_, at)| at)
}

/// Finds which closed shells lie inside which others, and from that and their senses what they
/// bound.
fn assign_roles(
    mesh: &Mesh,
    members: &Members,
    drafts: &[Draft],
    inside_out: &[bool],
    shells: &mut [Shell],
) {
    // Larger boxes first: a container comes before what it contains.
    let extent = |shell: usize| (drafts[shell].high - drafts[shell].low).length_squared();
    let mut order: Vec<usize> =
        (0..shells.len()).filter(|&shell| drafts[shell].loose == 0).collect();
    order.sort_by(|&a, &b| extent(b).total_cmp(&extent(a)).then(a.cmp(&b)));
    for (position, &inner) in order.iter().enumerate() {
        let draft = &drafts[inner];
        let around = |outer: usize| {
            let container = &drafts[outer];
            container.low.cmplt(draft.low).all() && container.high.cmpgt(draft.high).all()
        };
        if !order[..position].iter().any(|&outer| around(outer)) {
            continue;
        }
        // A shell that passes through another lies not inside it, wherever the file begins.
        let points = extremes(mesh, members.of(inner));
        // The smallest container decides: it is the last one found in this order.
        let parent = order[..position].iter().rev().copied().find(|&outer| {
            around(outer) && points.iter().all(|point| inside(mesh, members.of(outer), *point))
        });
        let Some(parent) = parent else { continue };
        let opposite = inside_out[inner] != inside_out[parent];
        shells[inner].role = match shells[parent].role {
            Role::Body | Role::Enclosed if opposite => Role::Void,
            Role::Void if opposite => Role::Enclosed,
            _ => Role::Embedded,
        };
    }
}

/// Whether `point` (not on the surface) lies inside a closed surface: parity of the triangles hit
/// along `+x`. A ray through an edge or vertex counts once, by the half-open rule with exact
/// orientation tests.
fn inside(mesh: &Mesh, triangles: impl Iterator<Item = u32>, point: DVec3) -> bool {
    let flat = |p: DVec3| Coord { x: p.y, y: p.z };
    let mut odd = false;
    for triangle in triangles {
        let corners = mesh.corners(triangle);
        if corners.iter().all(|c| c.x < point.x)
            || corners.iter().all(|c| c.y < point.y)
            || corners.iter().all(|c| c.y > point.y)
            || corners.iter().all(|c| c.z < point.z)
            || corners.iter().all(|c| c.z > point.z)
        {
            continue;
        }
        let mut hit = false;
        for (a, b) in [(0, 1), (1, 2), (2, 0)].map(|(a, b)| (corners[a], corners[b])) {
            let (low, high) = if a.z <= b.z { (a, b) } else { (b, a) };
            if low.z <= point.z
                && point.z < high.z
                && orient2d(flat(low), flat(high), flat(point)) > 0.0
            {
                hit = !hit;
            }
        }
        if hit {
            let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
            // normal.x is not zero: the projection has an inside.
            odd ^= (corners[0] - point).dot(normal) / normal.x > 0.0;
        }
    }
    odd
}

/// Triangles of each shell.
struct Members {
    starts: Vec<u32>,
    triangles: Vec<u32>,
}

impl Members {
    fn new(shell_of: &[u32], shells: usize) -> Self {
        if shells == 1 {
            return Self { starts: vec![0, shell_of.len() as u32], triangles: Vec::new() };
        }
        let mut starts = vec![0_u32; shells + 1];
        for &shell in shell_of {
            starts[shell as usize + 1] += 1;
        }
        for shell in 0..shells {
            starts[shell + 1] += starts[shell];
        }
        let mut cursor = starts.clone();
        let mut triangles = vec![0; shell_of.len()];
        for (triangle, &shell) in shell_of.iter().enumerate() {
            triangles[cursor[shell as usize] as usize] = triangle as u32;
            cursor[shell as usize] += 1;
        }
        Self { starts, triangles }
    }

    /// The triangles of `shell`; with a single shell the numbers themselves, so that no list is
    /// kept.
    fn of(&self, shell: usize) -> impl Iterator<Item = u32> + '_ {
        let range = self.starts[shell]..self.starts[shell + 1];
        range.map(|index| self.triangles.get(index as usize).copied().unwrap_or(index))
    }
}
