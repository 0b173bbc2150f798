//! STEP files of solids with known faces, written by code.

use std::collections::HashMap;
use std::f64::consts::TAU;

use glam::{DMat3, DVec2, DVec3};

/// A piece of an outline or profile, up to the next point.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Piece {
    Line,
    /// About a centre, counter-clockwise or clockwise.
    Arc(DVec2, bool),
    /// A parabola with this middle control point.
    Spline(DVec2),
    /// A line or arc whose surface is written as that of a curve turned or moved along.
    Swept(&'static Piece),
}

/// Points, each with the piece to the next one; the last piece ends at the first point.
pub(crate) type Outline = Vec<(DVec2, Piece)>;

/// A polygon.
pub(crate) fn polygon(points: &[DVec2]) -> Outline {
    points.iter().map(|&point| (point, Piece::Line)).collect()
}

/// A full circle in pieces, counter-clockwise or clockwise.
pub(crate) fn circle(centre: DVec2, radius: f64, pieces: u32, ccw: bool) -> Outline {
    let at = |k: u32| {
        let angle = TAU * f64::from(k) / f64::from(pieces);
        centre + radius * DVec2::from_angle(if ccw { angle } else { -angle })
    };
    (0..pieces).map(|k| (at(k), Piece::Arc(centre, ccw))).collect()
}

/// A solid under construction: the entities of its file.
pub(crate) struct Step {
    entities: Vec<String>,
    points: HashMap<[i64; 3], usize>,
    edges: HashMap<[usize; 2], Vec<(DVec3, usize)>>,
    faces: Vec<usize>,
    turn: DMat3,
    shift: DVec3,
    /// Radii of cylinders are written times this: a file that contradicts itself.
    pub wrong: f64,
}

/// A curve from one point to another.
#[derive(Clone, Copy)]
enum Curve {
    Line,
    /// Centre and axis; from the first point to the second counter-clockwise about the axis.
    Circle(DVec3, DVec3),
    Spline(DVec3),
}

impl Step {
    /// An empty solid, to be turned and shifted [mm].
    pub(crate) fn new((turn, shift): (DMat3, DVec3)) -> Self {
        Self {
            entities: Vec::new(),
            points: HashMap::new(),
            edges: HashMap::new(),
            faces: Vec::new(),
            turn,
            shift,
            wrong: 1.0,
        }
    }

    /// A closed profile `(r, z)`, counter-clockwise, turned about `z` in so many sectors.
    pub(crate) fn revolved(mut self, profile: &Outline, sectors: u32) -> Self {
        let angle = |k: u32| TAU * f64::from(k % sectors) / f64::from(sectors);
        let out = |k: u32| DVec2::from_angle(angle(k)).extend(0.0);
        let place = |point: DVec2, k: u32| point.x * out(k) + DVec3::Z * point.y;
        let ring = |point: DVec2| Curve::Circle(DVec3::Z * point.y, DVec3::Z);
        for k in 0..sectors {
            for (index, &(from, piece)) in profile.iter().enumerate() {
                let to = profile[(index + 1) % profile.len()].0;
                if from.x == 0.0 && to.x == 0.0 {
                    continue;
                }
                let profile_at = |k: u32| match piece {
                    Piece::Line | Piece::Swept(Piece::Line) => Curve::Line,
                    Piece::Arc(centre, ccw) | Piece::Swept(&Piece::Arc(centre, ccw)) => {
                        let axis = out(k).cross(DVec3::Z);
                        Curve::Circle(place(centre, k), if ccw { axis } else { -axis })
                    }
                    Piece::Spline(middle) => Curve::Spline(place(middle, k)),
                    Piece::Swept(_) => unreachable!(),
                };
                let mut edges = Vec::new();
                if from.x > 0.0 {
                    edges.push(self.edge(place(from, k), place(from, k + 1), ring(from), true));
                }
                edges.push(self.edge(
                    place(from, k + 1),
                    place(to, k + 1),
                    profile_at(k + 1),
                    true,
                ));
                if to.x > 0.0 {
                    edges.push(self.edge(place(to, k), place(to, k + 1), ring(to), false));
                }
                edges.push(self.edge(place(from, k), place(to, k), profile_at(k), false));
                let (surface, same) =
                    self.turned(from, to, piece, profile_at(k), place(from, k), place(to, k));
                self.face(&[edges], surface, same);
            }
        }
        self
    }

    /// Surface of a piece turned about `z`, and whether its normal points outward.
    fn turned(
        &mut self,
        from: DVec2,
        to: DVec2,
        piece: Piece,
        curve: Curve,
        start: DVec3,
        end: DVec3,
    ) -> (usize, bool) {
        let along = to - from;
        match piece {
            Piece::Line if along.y == 0.0 => {
                let axis = self.axis(DVec3::Z * from.y, DVec3::Z * -along.x.signum());
                (self.add(format!("PLANE('',#{axis})")), true)
            }
            Piece::Line if along.x == 0.0 => {
                let axis = self.axis(DVec3::Z * from.y, DVec3::Z);
                let radius = from.x * self.wrong;
                (self.add(format!("CYLINDRICAL_SURFACE('',#{axis},{radius:.16E})")), along.y > 0.0)
            }
            Piece::Line => {
                let grows = (along.y * along.x).signum();
                let axis = self.axis(DVec3::Z * from.y, DVec3::Z * grows);
                let angle = (along.x / along.y).abs().atan();
                (
                    self.add(format!("CONICAL_SURFACE('',#{axis},{:.16E},{angle:.16E})", from.x)),
                    along.y > 0.0,
                )
            }
            Piece::Arc(centre, ccw) => {
                let axis = self.axis(DVec3::Z * centre.y, DVec3::Z);
                let radius = centre.distance(from);
                let text = if centre.x == 0.0 {
                    format!("SPHERICAL_SURFACE('',#{axis},{radius:.16E})")
                } else {
                    format!("TOROIDAL_SURFACE('',#{axis},{:.16E},{radius:.16E})", centre.x)
                };
                (self.add(text), ccw)
            }
            Piece::Spline(_) | Piece::Swept(_) => {
                let curve = self.curve(start, end, curve);
                let (point, direction) = (self.point(DVec3::ZERO), self.direction(DVec3::Z));
                let axis = self.add(format!("AXIS1_PLACEMENT('',#{point},#{direction})"));
                (self.add(format!("SURFACE_OF_REVOLUTION('',#{curve},#{axis})")), true)
            }
        }
    }

    /// Outlines (the outer one counter-clockwise, holes clockwise) from `z = 0` to `height`.
    pub(crate) fn extruded(mut self, outlines: &[Outline], height: f64) -> Self {
        let curve = |piece: Piece, z: f64| match piece {
            Piece::Line | Piece::Swept(Piece::Line) => Curve::Line,
            Piece::Arc(centre, ccw) | Piece::Swept(&Piece::Arc(centre, ccw)) => {
                Curve::Circle(centre.extend(z), if ccw { DVec3::Z } else { -DVec3::Z })
            }
            Piece::Spline(middle) => Curve::Spline(middle.extend(z)),
            Piece::Swept(_) => unreachable!(),
        };
        let mut caps = [Vec::new(), Vec::new()];
        for outline in outlines {
            let mut rings = [Vec::new(), Vec::new()];
            for (index, &(from, piece)) in outline.iter().enumerate() {
                let to = outline[(index + 1) % outline.len()].0;
                let [a, b] = [from, to].map(|point| point.extend(0.0));
                let [c, d] = [from, to].map(|point| point.extend(height));
                let side = [
                    self.edge(a, b, curve(piece, 0.0), true),
                    self.edge(b, d, Curve::Line, true),
                    self.edge(c, d, curve(piece, height), false),
                    self.edge(a, c, Curve::Line, false),
                ];
                rings[0].insert(0, self.edge(a, b, curve(piece, 0.0), false));
                rings[1].push(self.edge(c, d, curve(piece, height), true));
                let (surface, same) = match piece {
                    Piece::Line => {
                        let axis = self.axis(a, (b - a).cross(DVec3::Z));
                        (self.add(format!("PLANE('',#{axis})")), true)
                    }
                    Piece::Arc(centre, ccw) => {
                        let axis = self.axis(centre.extend(0.0), DVec3::Z);
                        let radius = centre.distance(from) * self.wrong;
                        (self.add(format!("CYLINDRICAL_SURFACE('',#{axis},{radius:.16E})")), ccw)
                    }
                    Piece::Spline(_) | Piece::Swept(_) => {
                        let moved = self.curve(a, b, curve(piece, 0.0));
                        let direction = self.direction(DVec3::Z);
                        let vector = self.add(format!("VECTOR('',#{direction},1.)"));
                        (
                            self.add(format!("SURFACE_OF_LINEAR_EXTRUSION('',#{moved},#{vector})")),
                            true,
                        )
                    }
                };
                self.face(&[side.to_vec()], surface, same);
            }
            caps.iter_mut().zip(rings).for_each(|(cap, ring)| cap.push(ring));
        }
        for (cap, (z, normal)) in caps.iter().zip([(0.0, -DVec3::Z), (height, DVec3::Z)]) {
            let axis = self.axis(DVec3::Z * z, normal);
            let plane = self.add(format!("PLANE('',#{axis})"));
            self.face(cap, plane, true);
        }
        self
    }

    fn add(&mut self, text: String) -> usize {
        self.entities.push(text);
        self.entities.len()
    }

    fn point(&mut self, point: DVec3) -> usize {
        let [x, y, z] = (self.turn * point + self.shift).to_array();
        self.add(format!("CARTESIAN_POINT('',({x:.16E},{y:.16E},{z:.16E}))"))
    }

    fn direction(&mut self, direction: DVec3) -> usize {
        let [x, y, z] = (self.turn * direction.normalize()).to_array();
        self.add(format!("DIRECTION('',({x:.16E},{y:.16E},{z:.16E}))"))
    }

    fn axis(&mut self, point: DVec3, direction: DVec3) -> usize {
        let across = direction.normalize().any_orthonormal_vector();
        self.placed(point, direction, across)
    }

    fn placed(&mut self, point: DVec3, direction: DVec3, towards: DVec3) -> usize {
        let point = self.point(point);
        let (axis, towards) = (self.direction(direction), self.direction(towards));
        self.add(format!("AXIS2_PLACEMENT_3D('',#{point},#{axis},#{towards})"))
    }

    fn curve(&mut self, from: DVec3, to: DVec3, curve: Curve) -> usize {
        match curve {
            Curve::Line => {
                let (point, direction) = (self.point(from), self.direction(to - from));
                let vector = self.add(format!("VECTOR('',#{direction},1.)"));
                self.add(format!("LINE('',#{point},#{vector})"))
            }
            Curve::Circle(centre, axis) => {
                let placed = self.placed(centre, axis, from - centre);
                self.add(format!("CIRCLE('',#{placed},{:.16E})", from.distance(centre)))
            }
            Curve::Spline(middle) => {
                let [a, b, c] = [from, middle, to].map(|point| self.point(point));
                self.add(format!(
                    "B_SPLINE_CURVE_WITH_KNOTS('',2,(#{a},#{b},#{c}),.UNSPECIFIED.,.F.,.F.,(3,3),(0.,1.),.UNSPECIFIED.)"
                ))
            }
        }
    }

    fn vertex(&mut self, point: DVec3) -> usize {
        let key = (point * 1e6).round().to_array().map(|x| x as i64);
        if let Some(&vertex) = self.points.get(&key) {
            return vertex;
        }
        let own = self.point(point);
        let vertex = self.add(format!("VERTEX_POINT('',#{own})"));
        self.points.insert(key, vertex);
        vertex
    }

    /// An edge between two points, made when it is first asked for, as an oriented edge.
    fn edge(&mut self, from: DVec3, to: DVec3, curve: Curve, forward: bool) -> usize {
        let [a, b] = [self.vertex(from), self.vertex(to)];
        // Two half circles share their ends.
        let middle = match curve {
            Curve::Line | Curve::Spline(_) => (from + to) / 2.0,
            Curve::Circle(centre, axis) => {
                let out = from - centre;
                let ahead = axis.normalize().cross(out);
                let turn = (to - centre).dot(ahead).atan2((to - centre).dot(out)).rem_euclid(TAU);
                centre + (turn / 2.0).cos() * out + (turn / 2.0).sin() * ahead
            }
        };
        let known = |found: &Vec<(DVec3, usize)>| {
            found.iter().find(|(place, _)| place.distance(middle) < 1e-6).map(|(_, edge)| *edge)
        };
        if let Some(edge) = self.edges.get(&[a, b]).and_then(known) {
            return self.oriented(edge, forward);
        }
        if let Some(edge) = self.edges.get(&[b, a]).and_then(known) {
            return self.oriented(edge, !forward);
        }
        let curve = self.curve(from, to, curve);
        let edge = self.add(format!("EDGE_CURVE('',#{a},#{b},#{curve},.T.)"));
        self.edges.entry([a, b]).or_default().push((middle, edge));
        self.oriented(edge, forward)
    }

    fn oriented(&mut self, edge: usize, forward: bool) -> usize {
        let sense = if forward { "T" } else { "F" };
        self.add(format!("ORIENTED_EDGE('',*,*,#{edge},.{sense}.)"))
    }

    fn face(&mut self, loops: &[Vec<usize>], surface: usize, same: bool) {
        let mut bounds = Vec::new();
        for (index, edges) in loops.iter().enumerate() {
            let edges: Vec<String> = edges.iter().map(|edge| format!("#{edge}")).collect();
            let ring = self.add(format!("EDGE_LOOP('',({}))", edges.join(",")));
            let kind = if index == 0 { "FACE_OUTER_BOUND" } else { "FACE_BOUND" };
            bounds.push(format!("#{}", self.add(format!("{kind}('',#{ring},.T.)"))));
        }
        let sense = if same { "T" } else { "F" };
        let face =
            self.add(format!("ADVANCED_FACE('',({}),#{surface},.{sense}.)", bounds.join(",")));
        self.faces.push(face);
    }

    /// The file's text.
    pub(crate) fn text(mut self) -> String {
        let faces: Vec<String> = self.faces.iter().map(|face| format!("#{face}")).collect();
        let shell = self.add(format!("CLOSED_SHELL('',({}))", faces.join(",")));
        let solid = self.add(format!("MANIFOLD_SOLID_BREP('',#{shell})"));
        let mut add = |text: &str| self.add(text.to_string());
        let length = add("(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.MILLI.,.METRE.))");
        let angle = add("(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.))");
        let space = add("(NAMED_UNIT(*)SI_UNIT($,.STERADIAN.)SOLID_ANGLE_UNIT())");
        let near = add(&format!(
            "UNCERTAINTY_MEASURE_WITH_UNIT(LENGTH_MEASURE(1.E-07),#{length},'distance_accuracy_value','')"
        ));
        let context = add(&format!(
            "(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNCERTAINTY_ASSIGNED_CONTEXT((#{near}))GLOBAL_UNIT_ASSIGNED_CONTEXT((#{length},#{angle},#{space}))REPRESENTATION_CONTEXT('',''))"
        ));
        let shape = add(&format!("ADVANCED_BREP_SHAPE_REPRESENTATION('',(#{solid}),#{context})"));
        let application = add("APPLICATION_CONTEXT('')");
        let of_product = add(&format!("PRODUCT_CONTEXT('',#{application},'mechanical')"));
        let product = add(&format!("PRODUCT('part','part','',(#{of_product}))"));
        let version = add(&format!("PRODUCT_DEFINITION_FORMATION('','',#{product})"));
        let of_design =
            add(&format!("PRODUCT_DEFINITION_CONTEXT('part definition',#{application},'design')"));
        let definition = add(&format!("PRODUCT_DEFINITION('design','',#{version},#{of_design})"));
        let of_shape = add(&format!("PRODUCT_DEFINITION_SHAPE('','',#{definition})"));
        add(&format!("SHAPE_DEFINITION_REPRESENTATION(#{of_shape},#{shape})"));
        let lines: String = self
            .entities
            .iter()
            .enumerate()
            .map(|(k, text)| format!("#{}={text};\n", k + 1))
            .collect();
        format!(
            "ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION((''),'2;1');\nFILE_NAME('part','2026-01-01T00:00:00',(''),(''),'','','');\nFILE_SCHEMA(('AUTOMOTIVE_DESIGN'));\nENDSEC;\nDATA;\n{lines}ENDSEC;\nEND-ISO-10303-21;\n"
        )
    }
}
