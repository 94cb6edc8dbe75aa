//! What SPIRV-Tools said of the first mutants of each fixture.

/// The record of one fixture.
pub struct Recorded {
    /// Its path below `spirv-fixtures/`.
    pub name: String,
    /// Of the mutants; see [`digest`].
    pub digest: u64,
    /// Whether each is accepted.
    pub accepts: Vec<bool>,
}

/// Reads a record: a line for each fixture, its name last.
pub fn read(text: &str) -> impl Iterator<Item = Recorded> {
    text.lines().map(|line| {
        let mut parts = line.splitn(3, ' ');
        let mut part = || parts.next().expect("a line of three parts");
        let digest = u64::from_str_radix(part(), 16).expect("a number");
        let accepts = part().chars().map(|letter| letter == 'v').collect();
        Recorded { name: part().to_owned(), digest, accepts }
    })
}

/// Tells whether mutants are those of the record (FNV-1a of their words).
pub fn digest(mutants: &[(Vec<u32>, String)]) -> u64 {
    mutants.iter().flat_map(|(words, _)| words).fold(0xCBF2_9CE4_8422_2325, |hash, &word| {
        (hash ^ u64::from(word)).wrapping_mul(0x0000_0100_0000_01B3)
    })
}
