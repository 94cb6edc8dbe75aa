//! The container of binary glTF files, shared by benchmarks.

/// A GLB file of a JSON text and a buffer (glTF 2.0, "GLB File Format Specification").
pub fn glb(json: &str, buffer: &[u8]) -> Vec<u8> {
    let mut json = json.as_bytes().to_vec();
    json.resize(json.len().next_multiple_of(4), b' ');
    let chunk = |kind: u32, content: &[u8]| {
        [&(content.len() as u32).to_le_bytes(), &kind.to_le_bytes(), content].concat()
    };
    let chunks = [chunk(0x4E4F_534A, &json), chunk(0x004E_4942, buffer)].concat();
    let head = [0x4654_6C67, 2, 12 + chunks.len() as u32].map(u32::to_le_bytes).concat();
    [head, chunks].concat()
}
