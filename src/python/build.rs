//! Lets the extension's symbols of Python be found when Python loads it, where the linker must be told so (macOS).

fn main() {
    pyo3_build_config::add_extension_module_link_args();
}
