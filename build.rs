//! Compiles the STEP reader's C++ side, with the feature `step` only.

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    #[cfg(feature = "step")]
    step();
}

/// Links Open CASCADE as Debian installs it (`libocct-data-exchange-dev`), or where
/// `OCCT_INCLUDE_DIR` and `OCCT_LIB_DIR` say.
#[cfg(feature = "step")]
fn step() {
    const SOURCE: &str = "src/part/read/step.cpp";
    println!("cargo:rerun-if-changed={SOURCE}");
    println!("cargo:rerun-if-env-changed=OCCT_INCLUDE_DIR");
    println!("cargo:rerun-if-env-changed=OCCT_LIB_DIR");
    let include =
        std::env::var("OCCT_INCLUDE_DIR").unwrap_or_else(|_| "/usr/include/opencascade".into());
    let header = format!("{include}/Standard_Version.hxx");
    let Ok(version) = std::fs::read_to_string(&header) else {
        println!("cargo:warning=the feature `step` needs Open CASCADE: {header} is not there");
        println!(
            "cargo:warning=install libocct-data-exchange-dev and libocct-modeling-algorithms-dev, or set OCCT_INCLUDE_DIR and OCCT_LIB_DIR"
        );
        std::process::exit(1);
    };
    let number = |name: &str| -> u32 {
        let line = version.lines().find(|line| line.starts_with("#define") && line.contains(name));
        line.and_then(|line| line.split_whitespace().last()?.parse().ok()).unwrap_or(0)
    };
    cc::Build::new()
        .cpp(true)
        .std("c++14")
        .file(SOURCE)
        .include(&include)
        .flag_if_supported("-Wno-deprecated-declarations")
        .compile("gripfast_step");
    if let Ok(folder) = std::env::var("OCCT_LIB_DIR") {
        println!("cargo:rustc-link-search=native={folder}");
    }
    // The STEP libraries were renamed in 7.8.
    let step = if (number("OCC_VERSION_MAJOR"), number("OCC_VERSION_MINOR")) >= (7, 8) {
        "TKDESTEP"
    } else {
        "TKSTEP"
    };
    for library in [step, "TKXSBase", "TKMesh", "TKTopAlgo", "TKBRep", "TKG3d", "TKMath", "TKernel"]
    {
        println!("cargo:rustc-link-lib=dylib={library}");
    }
}
