//! Which graphics processor: listing, naming, and the rule that software never counts as one unless
//! asked for by name.

use crate::error::{Error, Result};

/// Environment variable that names the adapter when the flag `--adapter` does not.
pub const ADAPTER_VARIABLE: &str = "GRIPFAST_ADAPTER";

/// What the clock needs: timestamps of kernels, and of copies where there are those too.
pub(super) const TIMESTAMPS: wgpu::Features =
    wgpu::Features::TIMESTAMP_QUERY.union(wgpu::Features::TIMESTAMP_QUERY_INSIDE_ENCODERS);

/// An adapter as `gripfast devices` lists it.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct AdapterSummary {
    /// Number that `--adapter` takes.
    pub index: usize,
    /// Name that the driver gives.
    pub name: String,
    /// `discrete GPU`, `integrated GPU`, `virtual GPU`, `software` or `unknown`.
    pub kind: &'static str,
    /// `Vulkan`, `Metal` or `Dx12`.
    pub api: String,
    /// Driver and its version.
    pub driver: String,
    /// Whether `--backend auto` may take it.
    pub counts_as_gpu: bool,
    /// Largest buffer a kernel can bind \[bytes\].
    pub max_binding: u64,
    /// Largest buffer \[bytes\].
    pub max_buffer: u64,
    /// Workgroups per dimension of a dispatch.
    pub max_workgroups: u32,
    /// Invocations of a workgroup.
    pub max_invocations: u32,
    /// Memory of a workgroup \[bytes\].
    pub workgroup_memory: u32,
    /// Storage buffers that a kernel can bind.
    pub max_storage_buffers: u32,
    /// Smallest and largest number of lanes that run in step.
    pub subgroup: [u32; 2],
    /// Whether kernels can exchange numbers within a subgroup.
    pub subgroup_operations: bool,
    /// Whether the adapter tells the time of kernels.
    pub timestamps: bool,
    /// Whether it tells the time of copies too.
    pub timestamps_of_copies: bool,
    /// Length of a timestamp's tick \[ns\]; `None` without timestamps, or where the device did not
    /// open.
    pub timestamp_period: Option<f32>,
}

impl AdapterSummary {
    fn new(index: usize, adapter: &wgpu::Adapter) -> Self {
        let (info, limits, features) = (adapter.get_info(), adapter.limits(), adapter.features());
        let kind = match info.device_type {
            wgpu::DeviceType::DiscreteGpu => "discrete GPU",
            wgpu::DeviceType::IntegratedGpu => "integrated GPU",
            wgpu::DeviceType::VirtualGpu => "virtual GPU",
            wgpu::DeviceType::Cpu => "software",
            wgpu::DeviceType::Other => "unknown",
        };
        Self {
            index,
            kind,
            api: format!("{:?}", info.backend),
            driver: format!("{} {}", info.driver, info.driver_info).trim().to_owned(),
            counts_as_gpu: rank(info.device_type).is_some(),
            name: info.name,
            max_binding: limits.max_storage_buffer_binding_size,
            max_buffer: limits.max_buffer_size,
            max_workgroups: limits.max_compute_workgroups_per_dimension,
            max_invocations: limits.max_compute_invocations_per_workgroup,
            workgroup_memory: limits.max_compute_workgroup_storage_size,
            max_storage_buffers: limits.max_storage_buffers_per_shader_stage,
            subgroup: [info.subgroup_min_size, info.subgroup_max_size],
            subgroup_operations: features.contains(wgpu::Features::SUBGROUP),
            timestamps: features.contains(wgpu::Features::TIMESTAMP_QUERY),
            timestamps_of_copies: features.contains(TIMESTAMPS),
            timestamp_period: None,
        }
    }
}

/// Order of preference; `None` for what does not count as a GPU. `WGPU_POWER_PREF=low` prefers
/// integrated ones.
fn rank(kind: wgpu::DeviceType) -> Option<u32> {
    let low_power = wgpu::PowerPreference::from_env() == Some(wgpu::PowerPreference::LowPower);
    match kind {
        wgpu::DeviceType::DiscreteGpu => Some(1),
        wgpu::DeviceType::IntegratedGpu => Some(if low_power { 0 } else { 2 }),
        wgpu::DeviceType::VirtualGpu => Some(3),
        wgpu::DeviceType::Cpu | wgpu::DeviceType::Other => None,
    }
}

/// All adapters of the graphics interfaces that `WGPU_BACKEND` allows (default: all built in).
pub(crate) fn adapters() -> Vec<wgpu::Adapter> {
    let descriptor = wgpu::InstanceDescriptor::new_without_display_handle_from_env();
    let backends = descriptor.backends;
    pollster::block_on(wgpu::Instance::new(descriptor).enumerate_adapters(backends))
}

/// All adapters, in the order of their indices. Those that have timestamps are opened for a moment,
/// for only an open device tells their period.
pub fn list() -> Vec<AdapterSummary> {
    let summary = |(index, adapter): (usize, &wgpu::Adapter)| {
        let mut summary = AdapterSummary::new(index, adapter);
        if summary.timestamps {
            let descriptor = wgpu::DeviceDescriptor {
                required_features: wgpu::Features::TIMESTAMP_QUERY,
                ..Default::default()
            };
            let opened = pollster::block_on(adapter.request_device(&descriptor)).ok();
            summary.timestamp_period = opened.map(|(_, queue)| queue.get_timestamp_period());
        }
        summary
    };
    adapters().iter().enumerate().map(summary).collect()
}

/// The adapter asked for by index or part of its name (`--adapter`, else the environment variables
/// `GRIPFAST_ADAPTER` and `WGPU_ADAPTER_NAME`), or else the best that counts as a GPU.
///
/// # Errors
/// A device error when there is none; the message lists what there is.
pub(crate) fn choose(asked: Option<&str>) -> Result<wgpu::Adapter> {
    let from_environment = || {
        [ADAPTER_VARIABLE, "WGPU_ADAPTER_NAME"]
            .iter()
            .find_map(|name| std::env::var(name).ok())
            .filter(|name| !name.trim().is_empty())
    };
    let asked = asked.map(str::to_owned).or_else(from_environment);
    let mut all = adapters();
    let position = match &asked {
        Some(name) => position_of(
            name.trim(),
            &all.iter().map(|adapter| adapter.get_info().name).collect::<Vec<_>>(),
        ),
        None => {
            let ranks = all
                .iter()
                .enumerate()
                .filter_map(|(i, adapter)| Some((rank(adapter.get_info().device_type)?, i)));
            ranks.min().map(|(_, i)| i)
        }
    };
    if let Some(position) = position {
        return Ok(all.swap_remove(position));
    }
    let found = all.iter().enumerate().map(|(index, adapter)| AdapterSummary::new(index, adapter));
    let found: Vec<String> =
        found.map(|found| format!("[{}] {} ({})", found.index, found.name, found.kind)).collect();
    let found = if found.is_empty() {
        "no graphics adapter was found".to_owned()
    } else {
        format!("found: {}", found.join(", "))
    };
    Err(Error::device(match asked {
        Some(name) => format!("no adapter is called `{name}`; {found}"),
        None => format!(
            "no graphics processor; {found}. A software adapter is used only when its name is asked for"
        ),
    })
    .with_options(&["adapter"]))
}

/// An index, or else the first name that contains `asked` whatever the case.
fn position_of(asked: &str, names: &[String]) -> Option<usize> {
    if let Ok(index) = asked.parse::<usize>() {
        return (index < names.len()).then_some(index);
    }
    let asked = asked.to_lowercase();
    names.iter().position(|name| name.to_lowercase().contains(&asked))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn adapters_are_found_by_index_and_part_of_the_name() {
        let names = ["NVIDIA H200".to_owned(), "llvmpipe (LLVM 15.0.6, 256 bits)".to_owned()];
        assert_eq!(position_of("1", &names), Some(1));
        assert_eq!(position_of("2", &names), None);
        assert_eq!(position_of("LLVMpipe", &names), Some(1));
        assert_eq!(position_of("h200", &names), Some(0));
        assert_eq!(position_of("radeon", &names), None);
    }

    #[test]
    fn software_does_not_count_as_a_gpu() {
        assert_eq!(rank(wgpu::DeviceType::Cpu), None);
        assert_eq!(rank(wgpu::DeviceType::Other), None);
        assert!(rank(wgpu::DeviceType::DiscreteGpu) < rank(wgpu::DeviceType::VirtualGpu));
    }
}
