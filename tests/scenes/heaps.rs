//! Descriptor heaps in scenes: where resources may lie, and what commands say of them.

use anyhit_base::error::ErrorKind;
use anyhit_scene::{LoadOptions, SceneFiles, load_text};

use crate::support::files::root;

fn load(resources: &str) -> anyhit_base::error::Result<anyhit_scene::ResolvedScene> {
    let files = SceneFiles::default();
    let path = root().join("scene.toml");
    load_text(&path, &format!("version = 1\n{resources}"), &files, &LoadOptions::default())
}

#[test]
fn mistakes_in_heaps_are_errors() {
    let buffer = "[resources.a]\ntype = 'storage_buffer'\nsize = 4\n";
    let sampler = "[resources.a]\ntype = 'sampler'\n";
    let second = "[resources.b]\ntype = 'storage_image'\nsize = [1, 1]\n";
    let mistakes = [
        (format!("{buffer}heap = 3\n{second}heap = 3\n"), "two resources at index 3 of the resource heap"),
        (
            format!("{buffer}heap = 3\n{second}heap_offset = 96\n"),
            "two resources at index 3 of the resource heap",
        ),
        (format!("{buffer}heap_offset = 40\n"), "must be a multiple of 32 bytes"),
        (format!("{buffer}heap = 1048576\n"), "at most 1048576 descriptors"),
        (format!("{buffer}heap = 1\nheap_offset = 32\n"), "one place in a heap"),
        (format!("{buffer}heap = 1\nbinding = 2\n"), "has no `binding`"),
        (format!("{sampler}heap = 1\nset = 2\n"), "has no `set`"),
        (
            "[resources.a]\ntype = 'combined_image_sampler'\nsize = [1, 1]\nheap = 0\n".to_owned(),
            "a heap has no descriptors of this type",
        ),
        (
            "[resources.a]\ntype = 'heap_data'\nsize = 4\nheap = 0\n".to_owned(),
            "the data of a heap has no `heap`",
        ),
        (
            "[resources.a]\ntype = 'push_constant_bank'\nsize = 4\nbank = 0\n".to_owned(),
            "bank 0 is given by `push_constants`",
        ),
        (
            "[resources.a]\ntype = 'push_constant_bank'\nsize = 4\nbinding = 1\nbank = 1\n".to_owned(),
            "a bank of push constants has no `binding`",
        ),
    ];
    for (text, message) in mistakes {
        let error = load(&text).expect_err(&text);
        assert_eq!(error.kind(), ErrorKind::InvalidScene, "{}", error.render());
        assert!(error.render().contains(message), "{message}: {}", error.render());
    }
    // A sampler and a buffer have the same index in heaps of their own.
    assert!(load(&format!("{buffer}heap = 3\n[resources.b]\ntype = 'sampler'\nheap = 3\n")).is_ok());
}
