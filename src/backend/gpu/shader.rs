//! The kernels: their text, constants, binding layouts and pipelines.

use super::super::layout;
use super::super::problem::F32_TOLERANCE;

/// What all kernels share.
pub(crate) const LAYOUT: &str = include_str!("../../../shaders/layout.wgsl");
/// The basis kernel.
pub(crate) const FAN: &str = concat!(
    include_str!("../../../shaders/edge.wgsl"),
    "\n",
    include_str!("../../../shaders/fan.wgsl")
);
/// The functions that the screen searches with, and the screen.
pub(crate) const SCREEN: &str = concat!(
    include_str!("../../../shaders/search.wgsl"),
    "\n",
    include_str!("../../../shaders/screen.wgsl")
);

/// The same, and Newton's method.
pub(crate) const NEWTON: &str = concat!(
    include_str!("../../../shaders/search.wgsl"),
    "\n",
    include_str!("../../../shaders/screen.wgsl"),
    "\n",
    include_str!("../../../shaders/edge.wgsl"),
    "\n",
    include_str!("../../../shaders/cut.wgsl"),
    "\n",
    include_str!("../../../shaders/newton.wgsl")
);

/// Workgroups per row of a dispatch (the guaranteed least of every implementation is 65,535 per
/// dimension).
pub(crate) const GRID: u32 = 32_768;

/// The constants that the shaders leave open, from [`layout`].
pub(crate) fn constants() -> [(&'static str, f64); 46] {
    [
        ("GROUP", layout::GROUP as f64),
        ("BASIS_GROUP", layout::BASIS_GROUP as f64),
        ("NEAR_LIMIT", f64::from(layout::NEAR_LIMIT)),
        ("ON_LINE", f64::from(layout::ON_LINE)),
        ("SERIES_LIMIT", f64::from(layout::SERIES_LIMIT)),
        ("CONTACT_MARGIN", f64::from(layout::CONTACT_MARGIN)),
        ("COUPLING_MARGIN", f64::from(layout::COUPLING_MARGIN)),
        ("COUPLED_SHARE", f64::from(layout::COUPLED_SHARE)),
        ("LEAST_VARIATION", f64::from(layout::LEAST_VARIATION)),
        ("TILT_LIMIT", f64::from(layout::TILT_LIMIT)),
        ("LEAST_DISSIPATION", f64::from(layout::LEAST_DISSIPATION)),
        ("DEGENERATE", f64::from(layout::DEGENERATE)),
        ("OUT_OF_RANGE", f64::from(layout::OUT_OF_RANGE)),
        ("BOUNDED", f64::from(layout::BOUNDED)),
        ("UNBOUNDED", f64::from(layout::UNBOUNDED)),
        ("COUPLED", f64::from(layout::COUPLED)),
        ("OPEN", f64::from(layout::OPEN)),
        ("KINDS", f64::from(layout::KINDS)),
        ("F32_TOLERANCE", F32_TOLERANCE),
        ("RANGE", f64::from(layout::RANGE)),
        ("LEAST_LOAD", f64::from(layout::LEAST_LOAD)),
        ("MOST_PULL", f64::from(layout::MOST_PULL)),
        ("LOAD_ROUNDING", f64::from(layout::LOAD_ROUNDING)),
        ("LOAD_MARGIN", f64::from(layout::LOAD_MARGIN)),
        ("SWAY_CONGRUENT", f64::from(layout::SWAY_CONGRUENT)),
        ("SWAY_DIFFERENT", f64::from(layout::SWAY_DIFFERENT)),
        ("ESTIMATED", f64::from(layout::ESTIMATED)),
        ("EVERY", f64::from(layout::EVERY)),
        ("ESTIMATES", f64::from(layout::ESTIMATES)),
        ("MODES", f64::from(layout::MODES)),
        ("FAR_LIMIT", f64::from(layout::FAR_LIMIT)),
        ("CORRECTIONS", f64::from(layout::CORRECTIONS)),
        ("PRESSURE_STEPS", f64::from(layout::PRESSURE_STEPS)),
        ("PRESSED", f64::from(layout::PRESSED)),
        ("FALL", f64::from(layout::FALL)),
        ("SHORTER", f64::from(layout::SHORTER)),
        ("CONTRACTION", f64::from(layout::CONTRACTION)),
        ("WITHIN", f64::from(layout::WITHIN)),
        ("SHARP", f64::from(layout::SHARP)),
        ("QUIET", f64::from(layout::QUIET)),
        ("HARDLY", f64::from(layout::HARDLY)),
        ("LEAST_LEFT", f64::from(layout::LEAST_LEFT)),
        ("STEEPEST", f64::from(layout::STEEPEST)),
        ("ROUNDING", f64::from(layout::ROUNDING)),
        ("ESTIMATE_MARGIN", f64::from(layout::ESTIMATE_MARGIN)),
        ("GRID", f64::from(GRID)),
    ]
}

/// What a binding holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Access {
    Read,
    Write,
    Uniform,
}

/// Bindings of the basis kernel: contacts, edges, twists, basis, Gauss points.
pub(crate) const FAN_BINDINGS: [Access; 5] =
    [Access::Read, Access::Read, Access::Read, Access::Write, Access::Uniform];

/// Bindings of the screen, as many as every implementation has: contacts, edges, twists, basis,
/// listed loads, grips, tally, entries.
pub(crate) const SCREEN_BINDINGS: [Access; 8] = [
    Access::Read,
    Access::Read,
    Access::Read,
    Access::Read,
    Access::Read,
    Access::Read,
    Access::Write,
    Access::Write,
];

/// Bindings of Newton's method: those, and Gauss points.
pub(crate) const NEWTON_BINDINGS: [Access; 9] = {
    let [contacts, edges, twists, basis, cases, grips, tally, found] = SCREEN_BINDINGS;
    [contacts, edges, twists, basis, cases, grips, tally, found, Access::Uniform]
};

/// A compiled kernel.
#[derive(Debug)]
pub(crate) struct Kernel {
    pub(crate) pipeline: wgpu::ComputePipeline,
    pub(crate) bindings: wgpu::BindGroupLayout,
}

impl Kernel {
    pub(crate) fn new(device: &wgpu::Device, name: &str, text: &str, bindings: &[Access]) -> Self {
        let source = wgpu::ShaderSource::Wgsl(format!("{LAYOUT}\n{text}").into());
        let module =
            device.create_shader_module(wgpu::ShaderModuleDescriptor { label: Some(name), source });
        let entries: Vec<wgpu::BindGroupLayoutEntry> = bindings
            .iter()
            .zip(0..)
            .map(|(access, binding)| wgpu::BindGroupLayoutEntry {
                binding,
                visibility: wgpu::ShaderStages::COMPUTE,
                ty: wgpu::BindingType::Buffer {
                    ty: match access {
                        Access::Uniform => wgpu::BufferBindingType::Uniform,
                        Access::Read => wgpu::BufferBindingType::Storage { read_only: true },
                        Access::Write => wgpu::BufferBindingType::Storage { read_only: false },
                    },
                    has_dynamic_offset: false,
                    min_binding_size: None,
                },
                count: None,
            })
            .collect();
        let bindings = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some(name),
            entries: &entries,
        });
        let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(name),
            bind_group_layouts: &[Some(&bindings)],
            immediate_size: 0,
        });
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(name),
            layout: Some(&layout),
            module: &module,
            entry_point: Some(name),
            // Every workgroup writes its memory before it reads it.
            compilation_options: wgpu::PipelineCompilationOptions {
                constants: &constants(),
                zero_initialize_workgroup_memory: false,
            },
            cache: None,
        });
        Self { pipeline, bindings }
    }

    /// Binds `buffers` (with the number of bytes in use) in order.
    pub(crate) fn bind(
        &self,
        device: &wgpu::Device,
        buffers: &[(&wgpu::Buffer, u64)],
    ) -> wgpu::BindGroup {
        let entries: Vec<wgpu::BindGroupEntry<'_>> = buffers
            .iter()
            .zip(0..)
            .map(|((buffer, size), binding)| wgpu::BindGroupEntry {
                binding,
                resource: wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                    buffer,
                    offset: 0,
                    size: std::num::NonZeroU64::new(*size),
                }),
            })
            .collect();
        device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &self.bindings,
            entries: &entries,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use layout::{
        CaseRecord, ContactHeader, FoundRecord, GripRecord, LoadRecord, OutcomeRecord, SeedRecord,
        TwistRecord,
    };
    use std::mem::offset_of;

    fn module(text: &str) -> naga::Module {
        let text = format!("{LAYOUT}\n{text}");
        naga::front::wgsl::parse_str(&text)
            .unwrap_or_else(|error| panic!("{}", error.emit_to_string(&text)))
    }

    /// Offsets and size of a struct as the shader has it.
    fn in_shader(module: &naga::Module, name: &str) -> (Vec<(String, usize)>, usize) {
        let (_, found) =
            module.types.iter().find(|(_, found)| found.name.as_deref() == Some(name)).unwrap();
        let naga::TypeInner::Struct { members, span } = &found.inner else {
            panic!("{name} is no struct")
        };
        (
            members
                .iter()
                .map(|member| (member.name.clone().unwrap(), member.offset as usize))
                .collect(),
            *span as usize,
        )
    }

    macro_rules! assert_same_layout {
        ($module:expr, $record:ident: $($field:ident),+) => {
            let (members, span) = in_shader($module, stringify!($record));
            let expected = vec![$((stringify!($field).to_owned(), offset_of!($record, $field))),+];
            assert_eq!(members, expected, stringify!($record));
            assert_eq!(span, size_of::<$record>(), stringify!($record));
        };
    }

    #[test]
    fn records_have_the_same_offsets_in_rust_and_in_the_shaders() {
        for text in [FAN, SCREEN, NEWTON] {
            let module = module(text);
            assert_same_layout!(&module, ContactHeader: edges_i, edges_ii, edges_end, basis, faces, radius, area_i, area_ii, centroid_i, centroid_ii, compliance, resolved, variation_first, variation_second, variation_slope, softness, spread, tilt, slowest, quickest, padding);
            assert_same_layout!(&module, TwistRecord: twist, ring, padding);
            assert_same_layout!(&module, CaseRecord: force, force_size, moment, moment_size);
            assert_same_layout!(&module, GripRecord: row_1, force, row_2, moment, row_3, distance, lever, arm, contact, first, count, wanted);
            assert_same_layout!(&module, LoadRecord: wrench, scale, f3, m1, m2, distance);
            assert_same_layout!(&module, SeedRecord: twist, lower, upper, status, best, padding);
            assert_same_layout!(&module, OutcomeRecord: entries, floor);
            assert_same_layout!(&module, FoundRecord: words, upper, kind, load, grip);
        }
    }

    #[test]
    fn every_open_constant_is_set_and_none_is_missing() {
        let module = module("");
        let mut open: Vec<String> =
            module.overrides.iter().filter_map(|(_, constant)| constant.name.clone()).collect();
        let mut set: Vec<String> = constants().iter().map(|(name, _)| (*name).to_owned()).collect();
        open.sort();
        set.sort();
        assert_eq!(open, set);
        let fixed = |name: &str| {
            let line =
                LAYOUT.lines().find(|line| line.starts_with(&format!("const {name} "))).unwrap();
            line.split(['=', ';']).nth(1).unwrap().trim().trim_end_matches('u').to_owned()
        };
        assert_eq!(fixed("BASIS"), layout::BASIS.to_string());
        assert_eq!(fixed("GAUSS_POINTS"), layout::GAUSS.len().to_string());
        assert_eq!(fixed("RING"), super::super::super::RING.to_string());
        assert_eq!(fixed("NEGATED"), format!("{:#x}", super::super::super::NEGATED));
        assert_eq!(fixed("WINDOW"), layout::WINDOW.to_string());
        assert_eq!(fixed("WORDS"), (layout::WINDOW / 32).to_string());
        assert_eq!(fixed("BITS"), layout::BITS.to_string());
        assert_eq!(fixed("PART"), layout::PART.to_string());
        assert_eq!(fixed("PART_WORDS"), (layout::PART / 32).to_string());
        assert_eq!(fixed("INFINITE"), format!("{:#x}", f32::INFINITY.to_bits()));
        assert_eq!(fixed("LARGEST").parse::<f32>().unwrap(), f32::MAX);
    }

    #[test]
    fn bindings_are_those_of_the_shaders() {
        for (text, bindings) in [
            (FAN, FAN_BINDINGS.as_slice()),
            (SCREEN, SCREEN_BINDINGS.as_slice()),
            (NEWTON, NEWTON_BINDINGS.as_slice()),
        ] {
            let module = module(text);
            let mut found: Vec<(u32, Access)> = module
                .global_variables
                .iter()
                .filter_map(|(_, variable)| {
                    let access = match variable.space {
                        naga::AddressSpace::Uniform => Access::Uniform,
                        naga::AddressSpace::Storage { access }
                            if access.contains(naga::StorageAccess::STORE) =>
                        {
                            Access::Write
                        }
                        naga::AddressSpace::Storage { .. } => Access::Read,
                        _ => return None,
                    };
                    Some((variable.binding.unwrap().binding, access))
                })
                .collect();
            found.sort_by_key(|(binding, _)| *binding);
            assert_eq!(found, (0..).zip(bindings.iter().copied()).collect::<Vec<_>>());
        }
    }
}
