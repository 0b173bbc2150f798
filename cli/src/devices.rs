//! `gripfast devices`: the graphics adapters that `--adapter` can name.

use std::io::Write;
use std::process::ExitCode;

use clap::Args as ClapArgs;

/// Lists the graphics adapters: number, name, driver, type, limits, timestamps.
#[derive(Debug, ClapArgs)]
#[command(
    after_help = "EXAMPLES:\n  gripfast devices\n  gripfast devices --json\n  WGPU_BACKEND=vulkan gripfast devices\n\n\
`--backend auto` and `gpu` take the first discrete, integrated or virtual GPU; a software adapter only when `--adapter` or GRIPFAST_ADAPTER names it."
)]
pub(crate) struct Args {
    /// A JSON list on standard output.
    #[arg(long)]
    json: bool,
}

#[cfg(feature = "gpu")]
pub(crate) fn run(args: Args) -> anyhow::Result<ExitCode> {
    let adapters = gripfast::backend::list_adapters();
    let mut out = crate::terminal::answer(args.json);
    if args.json {
        serde_json::to_writer_pretty(&mut out, &adapters)?;
        writeln!(out)?;
    } else if adapters.is_empty() {
        writeln!(out, "no graphics adapter found; everything runs on the processor")?;
    } else {
        let mut table = comfy_table::Table::new();
        table.load_style(comfy_table::presets::NOTHING);
        table.set_header([
            "",
            "name",
            "type",
            "interface",
            "driver",
            "largest binding",
            "workgroup",
            "subgroup",
            "timestamps",
            "taken by auto",
        ]);
        for adapter in &adapters {
            table.add_row([
                adapter.index.to_string(),
                adapter.name.clone(),
                adapter.kind.to_owned(),
                adapter.api.clone(),
                adapter.driver.clone(),
                format!("{} MiB", adapter.max_binding >> 20),
                format!(
                    "{} lanes, {} KiB",
                    adapter.max_invocations,
                    adapter.workgroup_memory >> 10
                ),
                format!(
                    "{} to {}{}",
                    adapter.subgroup[0],
                    adapter.subgroup[1],
                    if adapter.subgroup_operations { "" } else { ", no exchange" }
                ),
                match (adapter.timestamp_period, adapter.timestamps_of_copies) {
                    (Some(period), true) => format!("{period} ns"),
                    (Some(period), false) => format!("{period} ns, kernels only"),
                    (None, _) => "none".to_owned(),
                },
                if adapter.counts_as_gpu { "yes" } else { "no: software" }.to_owned(),
            ]);
        }
        writeln!(out, "{}", table.to_string().trim_end())?;
    }
    Ok(if adapters.is_empty() { ExitCode::from(1) } else { ExitCode::SUCCESS })
}

#[cfg(not(feature = "gpu"))]
pub(crate) fn run(args: Args) -> anyhow::Result<ExitCode> {
    let text = if args.json {
        "[]"
    } else {
        "this build has no GPU support (cargo feature `gpu`); everything runs on the processor"
    };
    writeln!(std::io::stdout().lock(), "{text}")?;
    Ok(ExitCode::from(1))
}
