//! The tests of the crate as one program: it links once.

#[path = "../two_layers/mod.rs"]
mod two_layers;

mod bilayers;
mod mean_strain;
mod paper_equations;
mod published;
mod strain_reference;
