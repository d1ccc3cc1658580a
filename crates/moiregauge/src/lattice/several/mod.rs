//! Several lattices in one image, each measured with the others taken off.
//!
//! In: an image that shows N lattices (twisted bilayer graphene on aligned hBN, a twisted trilayer). Out: all of
//! them, with the errors that they have beside each other.
//!
//! The strongest lattice is fitted, its model is taken off, and the next one is looked for in what is left. Then
//! they take turns: each is fitted anew to the image less the models of the others, until none moves by more than
//! a small part of its error. Every turn shrinks what is left by the square of the correlation of the lattices,
//! which is small unless their wave vectors lie within a cycle per frame.
//!
//! A fit that takes the others as known is too sure of itself. With the Fisher matrix F of all lattices in white
//! noise, `C = (F⁻¹)_kk` is what lattice k has beside the others and `C₀ = (F_kk)⁻¹` by itself; the covariance of
//! its fit goes through the linear map that takes `C₀` to `C`.
//!
//! # References
//! Buja, Hastie and Tibshirani, Ann. Statist. 17, 453 (1989), backfitting.

pub(crate) mod atoms;
pub(crate) mod entangled;
pub(crate) mod together;

pub use together::measure_several;
