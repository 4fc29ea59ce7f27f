//! The shared library's own name: programs ask for `libquell.so.0`, whatever the file is called where it is built.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    if std::env::var("CARGO_CFG_TARGET_OS").is_ok_and(|os| os == "linux") {
        println!("cargo::rustc-cdylib-link-arg=-Wl,-soname,libquell.so.0");
    }
}
