//! What the kernels cost and what adapters can do: the counts of docs/performance.md and the
//! numbers of the makers.

/// Instructions of one lane in the screen, for one load and one twist: congruent faces, different
/// ones.
pub(crate) const EVALUATION: [f64; 2] = [8.0, 16.0];

/// Instructions of one lane in the screen, for one load: made (50), its ring (450; 900), the width of
/// its bounds (30; 150).
pub(crate) const LOAD: [f64; 2] = [530.0, 1100.0];

/// Instructions of one lane in the basis, for one edge, face and twist: the mean over the near and
/// far twists of a set.
pub(crate) const BASIS_EDGE: f64 = 650.0;

/// Bytes that the screen reads for one load of a grip; from the cache where the list fits it.
pub(crate) const LOAD_BYTES: f64 = 32.0;

/// Bytes of a grip: its record in, its outcome out.
pub(crate) const GRIP_BYTES: f64 = 88.0;

/// Bytes of an entry: cleared, written, copied for the way back.
pub(crate) const ENTRY_BYTES: f64 = 128.0;

/// Bytes of the basis for one face and twist.
pub(crate) const BASIS_BYTES: f64 = 48.0;

/// What an adapter can do at most.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub(crate) struct Limits {
    /// Single-precision instructions of one lane per second (half of the FLOP/s that makers give,
    /// who count a fused product twice).
    pub(crate) lanes: f64,
    /// Device memory [bytes/s].
    pub(crate) memory: f64,
}

/// Part of the name; TFLOP/s of single precision without tensor units; GB/s.
const ADAPTERS: [(&str, f64, f64); 14] = [
    ("H200", 60.0, 4800.0),
    ("H100 PCIe", 51.0, 2000.0),
    ("H100", 60.0, 3350.0),
    ("A100-SXM4-80GB", 19.5, 2039.0),
    ("A100", 19.5, 1555.0),
    ("L40S", 91.6, 864.0),
    ("L40", 90.5, 864.0),
    ("A10", 31.2, 600.0),
    ("L4", 30.3, 300.0),
    ("T4", 8.1, 320.0),
    ("V100", 15.7, 900.0),
    ("RTX 4090", 82.6, 1008.0),
    ("RTX 4080", 48.7, 717.0),
    ("RTX 3090", 35.6, 936.0),
];

/// The limits of an adapter by its name, or what the user says; `None` when neither knows.
pub(crate) fn limits(name: &str, tflops: Option<f64>, gigabytes: Option<f64>) -> Option<Limits> {
    let known = ADAPTERS.iter().find(|(part, ..)| {
        // A whole word or words: `A10` is no `A100`.
        name.match_indices(part).any(|(at, _)| {
            let after = name[at + part.len()..].chars().next();
            let before = name[..at].chars().next_back();
            let word = |c: Option<char>| c.is_some_and(|c| c.is_ascii_alphanumeric());
            !word(before) && !word(after)
        })
    });
    Some(Limits {
        lanes: tflops.or(known.map(|&(_, tflops, _)| tflops))? * 0.5e12,
        memory: gigabytes.or(known.map(|&(.., memory)| memory))? * 1e9,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn adapters_are_known_by_whole_words_of_their_names() {
        let memory = |name: &str| limits(name, None, None).map(|found| found.memory);
        assert_eq!(memory("NVIDIA H200 (Vulkan, 570.1)"), Some(4.8e12));
        assert_eq!(memory("NVIDIA H100 80GB HBM3"), Some(3.35e12));
        assert_eq!(memory("NVIDIA H100 PCIe"), Some(2e12));
        assert_eq!(memory("NVIDIA A10"), Some(6e11));
        assert_eq!(memory("NVIDIA A100-SXM4-80GB"), Some(2.039e12));
        assert_eq!(memory("llvmpipe (LLVM 15.0.6, 256 bits)"), None);
        let told = limits("llvmpipe", Some(2.0), Some(10.0)).unwrap();
        assert_eq!((told.lanes, told.memory), (1e12, 1e10));
    }
}
