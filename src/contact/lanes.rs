//! Edges side by side: the form in which the sums over edges become vector instructions.

use glam::DVec2;

/// Edges in one block. The loops over it are written so that the compiler turns them into vector
/// instructions: four numbers wide where the processor can, else two at a time, with the same bits
/// in the result.
pub(super) const LANES: usize = 4;

/// Numbers of the edges of a block.
pub(super) type Lane = [f64; LANES];

/// Directed edges `a -> b` with unit tangent `t` and length. Unused places hold an edge of length
/// zero.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(align(32))]
pub(super) struct Block {
    pub(super) ax: Lane,
    pub(super) ay: Lane,
    pub(super) bx: Lane,
    pub(super) by: Lane,
    pub(super) t1: Lane,
    pub(super) t2: Lane,
    pub(super) length: Lane,
}

impl Block {
    /// Edges of length zero at a point; tangents and lengths of what is put in come with
    /// [`Block::measure`].
    pub(super) fn at(point: DVec2) -> Self {
        let (x, y) = ([point.x; LANES], [point.y; LANES]);
        Self {
            ax: x,
            ay: y,
            bx: x,
            by: y,
            t1: [0.0; LANES],
            t2: [0.0; LANES],
            length: [0.0; LANES],
        }
    }

    /// Tangents and lengths from the points.
    #[inline(always)]
    pub(super) fn measure(&mut self) {
        for i in 0..LANES {
            let (x, y) = (self.bx[i] - self.ax[i], self.by[i] - self.ay[i]);
            let length = (x * x + y * y).sqrt();
            let inverse = if length > 0.0 { 1.0 / length } else { 0.0 };
            self.t1[i] = x * inverse;
            self.t2[i] = y * inverse;
            self.length[i] = length;
        }
    }
}

/// Sum over the lanes, in an order that does not depend on the width of the vectors.
#[inline(always)]
pub(super) fn total(lane: &Lane) -> f64 {
    (lane[0] + lane[2]) + (lane[1] + lane[3])
}

/// [`total`] of each. Not by `map`, which is not always compiled into the loop around it: a fifth of the
/// time of all exact solves.
#[inline(always)]
pub(super) fn totals<const COUNT: usize>(lanes: &[Lane; COUNT]) -> [f64; COUNT] {
    let mut sums = [0.0; COUNT];
    for i in 0..COUNT {
        sums[i] = total(&lanes[i]);
    }
    sums
}

/// Defines a function that runs `$kernel` (which must be `#[inline(always)]`) compiled for the
/// widest vectors that the processor at hand has.
macro_rules! widest {
    ($(#[$doc:meta])* $vis:vis fn $name:ident($($argument:ident: $type:ty),*) -> $out:ty = $kernel:ident) => {
        $(#[$doc])*
        #[allow(unsafe_code, reason = "measured: twice as fast; sound because the processor was asked for the instructions")]
        $vis fn $name($($argument: $type),*) -> $out {
            #[cfg(target_arch = "x86_64")]
            if std::arch::is_x86_feature_detected!("avx512f")
                && std::arch::is_x86_feature_detected!("avx512dq")
                && std::arch::is_x86_feature_detected!("avx512vl")
            {
                #[target_feature(enable = "avx512f,avx512dq,avx512vl")]
                fn widest($($argument: $type),*) -> $out {
                    $kernel($($argument),*)
                }
                // SAFETY: the processor has these parts of AVX-512.
                return unsafe { widest($($argument),*) };
            }
            #[cfg(target_arch = "x86_64")]
            if std::arch::is_x86_feature_detected!("avx2") {
                #[target_feature(enable = "avx2")]
                fn wide($($argument: $type),*) -> $out {
                    $kernel($($argument),*)
                }
                // SAFETY: the processor has AVX2.
                return unsafe { wide($($argument),*) };
            }
            $kernel($($argument),*)
        }
    };
}
pub(crate) use widest;
