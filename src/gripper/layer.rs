//! How far the pads give.

use super::Gripper;

/// The soft layer of a pad: a bed of springs on a rigid plate.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Layer {
    /// Pressure per compression [Pa/m].
    pub stiffness: f64,
    /// Thickness \[m\]; of a rigid pad zero.
    pub thickness: f64,
    /// Whether the gripper file states what the stiffness follows from; else it is
    /// [`CONFINED_MODULUS`] over the thickness.
    pub stated: bool,
}

/// Modulus of a layer whose file says nothing, pressed without room to the sides \[Pa\]: soft
/// rubber, some 50 Shore A.
pub const CONFINED_MODULUS: f64 = 10e6;
/// Thickness of a layer whose file says nothing \[m\].
pub const THICKNESS: f64 = 2e-3;
/// Poisson's ratio of rubber with some room to the sides, where the file states none.
const POISSON: f64 = 0.45;
/// Stiffness of a pad without a layer [Pa/m]: a cylinder of 10 mm radius then touches over a tenth
/// of a millimetre, as steel on steel does.
pub(super) const RIGID: f64 = 1e13;
/// Reach of a pad without a layer \[m\].
const RIGID_REACH: f64 = 2e-5;

impl Layer {
    /// How far behind a pad's plane it may touch anything \[m\]: its thickness, of a rigid pad next
    /// to nothing.
    pub fn reach(&self) -> f64 {
        self.thickness.max(RIGID_REACH)
    }
}

impl Gripper {
    /// The layer of the pads: `pad.stiffness` of the gripper file; else from Young's modulus `E`,
    /// Poisson's ratio `v` and thickness `t` the confined modulus `E (1 - v)/((1 + v)(1 - 2 v))`
    /// over `t`; else [`CONFINED_MODULUS`] over `t`.
    pub fn layer(&self) -> Layer {
        let thickness = self.pad_thickness.unwrap_or(THICKNESS);
        if let Some(stiffness) = self.pad_stiffness {
            let thickness = if stiffness >= RIGID { 0.0 } else { thickness };
            return Layer { stiffness, thickness, stated: true };
        }
        let v = self.pad_poisson.unwrap_or(POISSON);
        let confined = |e: f64| e * (1.0 - v) / ((1.0 + v) * (1.0 - 2.0 * v));
        let modulus = self.pad_modulus.map_or(CONFINED_MODULUS, confined);
        Layer { stiffness: modulus / thickness, thickness, stated: self.pad_modulus.is_some() }
    }
}

#[cfg(test)]
mod tests {
    use crate::gripper::find;

    #[test]
    fn the_layer_follows_from_what_the_file_states() {
        let mut gripper = find("generic").unwrap();
        (gripper.pad_stiffness, gripper.pad_modulus, gripper.pad_poisson) = (None, None, None);
        gripper.pad_thickness = None;
        let layer = gripper.layer();
        assert!((layer.stiffness - 5e9).abs() < 1.0 && !layer.stated, "{layer:?}");
        gripper.pad_thickness = Some(1e-3);
        assert!((gripper.layer().stiffness - 1e10).abs() < 1.0);
        // Without sideways contraction the confined modulus is Young's.
        (gripper.pad_modulus, gripper.pad_poisson) = (Some(3e6), Some(0.0));
        assert!((gripper.layer().stiffness - 3e9).abs() < 1.0 && gripper.layer().stated);
        gripper.pad_poisson = Some(0.4);
        let expected = 3e9 * 0.6 / (1.4 * 0.2);
        assert!((gripper.layer().stiffness - expected).abs() < 1.0);
        gripper.pad_stiffness = Some(7e9);
        assert_eq!(gripper.layer().stiffness, 7e9);
    }
}
