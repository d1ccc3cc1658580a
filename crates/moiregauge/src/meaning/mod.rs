//! What a lattice means: twist and strain with everything that is uncertain about them, and what else it can mean.

pub(crate) mod about;
pub(crate) mod budget;
pub(crate) mod naming;
pub(crate) mod readings;
pub(crate) mod ruler;
pub(crate) mod strengths;
pub(crate) mod tensor;

pub use about::caveats;
pub use budget::{Budget, Contribution, Source};
pub use naming::{NameReading, Naming, Standing};
pub use readings::Readings;
pub use strengths::WaveStrengths;
pub use tensor::{SenseReading, TensorReading};
