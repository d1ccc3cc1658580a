//! New files of the page are found without a change of code.

fn main() {
    println!("cargo::rerun-if-changed=page");
}
