//! The tests of the crate as one program: it links once, and whatever takes long runs beside the rest.

mod calibrate;
mod candidates;
mod caveats;
mod chain;
mod constants;
mod doubtful_sensors;
mod draws;
mod fit_scene;
mod hard_lattices;
mod house;
mod identity;
mod lattice_fit;
mod lattice_names;
mod maps_of_scans;
mod noiseless;
mod one_frame;
mod overlap;
mod partly_covered;
mod plan;
mod real_samples;
mod ruler;
mod sample_classes;
mod sensor_lag;
mod several_lattices;
mod simulate;
mod sources;
mod strain_properties;
mod strain_statistics;
mod strain_tensor;
mod summed_autocorrelation;
mod tensor_scene;
mod twist_sense;
#[path = "../../../heterostrain/tests/two_layers/mod.rs"]
mod two_layers;
