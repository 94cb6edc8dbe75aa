//! The folders of cases/ as one test; `anyhit test cases` tells more.

use std::path::Path;

#[test]
fn all_cases_hold() -> anyhit::Result<()> {
    let cases = anyhit::Case::discover(Path::new("cases"))?;
    assert_eq!(cases.len(), 2);
    for case in cases {
        case.check()?;
    }
    Ok(())
}
