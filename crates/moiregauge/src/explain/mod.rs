//! How well a lattice predicts pixels that were held out.
//!
//! In: an image without its background and a lattice. Out: how much better it is predicted, block by block.
//!
//! Bands of lines are held out in turn. The amplitudes of the harmonics are fitted to the other bands and predict the blocks of those that are held out
//! (Stone, J. R. Stat. Soc. B 36, 111 (1974), cross-validation). The scatter of the gain over blocks is its standard error, enlarged where bands scatter
//! more, so that no model of the noise is needed: whatever differs from block to block, or from line to line, enlarges the error. Two descriptions are compared by the mean difference of their gains in
//! standard errors.

pub(crate) mod beside;
pub(crate) mod cells;
pub(crate) mod evidence;
pub(crate) mod lanes;
pub(crate) mod normal;
pub(crate) mod phases;
pub(crate) mod scene;
pub(crate) mod split;
pub(crate) mod table;
pub(crate) mod waves;

#[cfg(test)]
mod tests;
