//! Random numbers that depend on the seed, the name of their use and the draw, never on threads.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};

/// The random stream for draw `index` of the use called `name`.
///
/// Streams with different names or indices are independent; the same three arguments give the
/// same numbers on every machine.
pub fn stream(seed: u64, name: &str, index: u64) -> ChaCha8Rng {
    // FNV-1a: a fixed, documented hash. The std hashers may change between releases.
    let hash = name.bytes().fold(0xcbf2_9ce4_8422_2325_u64, |h, byte| {
        (h ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
    });
    let mut rng = ChaCha8Rng::seed_from_u64(seed ^ hash);
    rng.set_stream(index);
    rng
}

/// Independent numbers of the standard normal distribution from [`stream`].
pub fn normals(seed: u64, name: &str, index: u64) -> impl FnMut() -> f64 {
    let mut stream = stream(seed, name, index);
    move || StandardNormal.sample(&mut stream)
}
