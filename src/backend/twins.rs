//! Holds the shaders and their Rust twins against each other, by the names of what they define.

/// The names that follow `keyword` at the start of an item, in order, up to the tests.
fn names(text: &str, keyword: &str) -> Vec<String> {
    text.split("#[cfg(test)]")
        .next()
        .into_iter()
        .flat_map(str::lines)
        .filter_map(|line| {
            let item =
                line.trim_start().trim_start_matches("pub(crate) ").trim_start_matches("pub ");
            let rest = item.strip_prefix(keyword)?.strip_prefix(' ')?;
            let end = rest.find(|c: char| !(c.is_alphanumeric() || c == '_'));
            Some(rest[..end.unwrap_or(rest.len())].to_owned())
        })
        .collect()
}

#[test]
fn shaders_and_their_twins_have_the_same_functions_in_the_same_order() {
    let mut fan = names(include_str!("../../shaders/edge.wgsl"), "fn");
    fan.extend(names(include_str!("../../shaders/fan.wgsl"), "fn"));
    assert_eq!(fan, names(include_str!("fan.rs"), "fn"));
    let search = names(include_str!("../../shaders/search.wgsl"), "fn");
    assert_eq!(search, names(include_str!("search.rs"), "fn"));
    let screen = names(include_str!("../../shaders/screen.wgsl"), "fn");
    assert_eq!(screen, names(include_str!("gpu/twin.rs"), "fn"));
    let cut = names(include_str!("../../shaders/cut.wgsl"), "fn");
    assert_eq!(cut, names(include_str!("gpu/cut.rs"), "fn"));
    let newton = names(include_str!("../../shaders/newton.wgsl"), "fn");
    assert_eq!(newton, names(include_str!("gpu/newton.rs"), "fn"));
    assert!(screen.contains(&"doubt".to_owned()) && cut.contains(&"integrate".to_owned()));
    assert!(newton.contains(&"estimate".to_owned()));
    assert!(fan.contains(&"fill_basis".to_owned()) && search.contains(&"support".to_owned()));
}

#[test]
fn records_are_in_the_same_order_in_the_shaders() {
    let shader = names(include_str!("../../shaders/layout.wgsl"), "struct");
    assert_eq!(shader, names(include_str!("layout.rs"), "struct"));
    assert!(shader.contains(&"SeedRecord".to_owned()));
}
