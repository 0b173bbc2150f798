//! Facets that are meant as planes.

use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

use gripfast::part::{Part, ReadOptions};

/// A bar of regular outline in a file of its own, as triangles.
fn bar(folder: &Path, sides: u32) -> PathBuf {
    let corner = |k: u32, z: f64| {
        let angle = TAU * f64::from(k % sides) / f64::from(sides);
        [20.0 * angle.cos(), 20.0 * angle.sin(), z]
    };
    let mut triangles = Vec::new();
    for k in 0..sides {
        let [a, b, c, d] =
            [corner(k, 0.0), corner(k + 1, 0.0), corner(k, 50.0), corner(k + 1, 50.0)];
        triangles.extend([[a, b, d], [a, d, c], [b, a, [0.0; 3]], [c, d, [0.0, 0.0, 50.0]]]);
    }
    let facet = |points: &[[f64; 3]; 3]| {
        let vertices = points.map(|[x, y, z]| format!("vertex {x:.9e} {y:.9e} {z:.9e}\n"));
        format!("facet normal 0 0 0\nouter loop\n{}endloop\nendfacet\n", vertices.concat())
    };
    let text: String = triangles.iter().map(facet).collect();
    let path = folder.join(format!("bar{sides}.stl"));
    std::fs::write(&path, format!("solid bar\n{text}endsolid bar\n")).unwrap();
    path
}

#[test]
fn facets_that_are_meant_as_planes_are_planes() {
    let folder = tempfile::tempdir().unwrap();
    for sides in [8, 12, 16, 48] {
        let path = bar(folder.path(), sides);
        let round = Part::read(&path, &ReadOptions::default()).unwrap();
        assert_eq!(round.curved.len(), 1, "{sides}");
        assert_eq!(round.curved[0].is_doubtful(), sides <= 16, "{sides}");
        let part = Part::read(&path, &ReadOptions::default().with_faceted(true)).unwrap();
        assert_eq!((part.faces.len(), part.curved.len()), (sides as usize + 2, 0), "{sides}");
        assert_eq!(part.pairs(0.0, 1.0).len(), sides as usize / 2 + 1, "{sides}");
        assert_eq!(part.symmetry(), None);
    }
}
