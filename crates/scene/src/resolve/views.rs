//! Views: resources whose memory is that of another one.

use std::sync::Arc;

use crate::descriptor_kind::DescriptorKind;
use crate::image_entry::ImageContent;
use crate::read::{Named, Spanned, unknown_name};
use crate::resolve::Resolver;
use crate::resolved::{ResolvedBinding, UnboundBuffer};
use crate::resources::{BufferView, Content, Resource};
use crate::view_entry::{RangeEntry, ViewEntry};
use anyhit_base::error::{Error, Place, Result};
use anyhit_engine::machine::Buffer;
use anyhit_engine::machine::format::Format;
use anyhit_engine::machine::sampler::Sampler;

/// What a view may be a view of.
pub(super) struct Viewed<'a> {
    pub bound: &'a [ResolvedBinding],
    pub unbound: &'a [UnboundBuffer],
}

/// What a name stands for.
enum Found<'a> {
    /// A buffer with its size, and where it is.
    Buffer(u64, &'a Place),
    Image(&'a Arc<ImageContent>, &'a Place),
    Texels(&'a Arc<ImageContent>, &'a Place),
}

impl Resolver<'_> {
    /// The content of a view, when all that is none is known.
    pub(super) fn view(&self, entry: &ViewEntry, viewed: &Viewed<'_>) -> Option<Resource> {
        let found = self.report.keep(self.viewed(&entry.of, viewed))??;
        match (entry.kind, found) {
            (kind, Found::Buffer(size, place)) if kind.is_buffer() => self
                .report
                .keep(range(&entry.of.value, kind, &entry.range, size, place))
                .map(Resource::BufferView),
            (kind, Found::Image(image, place)) if kind.is_image() => {
                self.report.keep(check_format(entry, image, place))?;
                Some(match kind {
                    DescriptorKind::StorageImage => Resource::StorageImage(image.clone()),
                    DescriptorKind::SampledImage => Resource::SampledImage(image.clone()),
                    _ => {
                        let sampler =
                            entry.sampler.as_ref().map_or(Some(Sampler::default()), |of| self.sampler(of));
                        Resource::CombinedImageSampler(image.clone(), sampler?)
                    }
                })
            }
            (kind, Found::Texels(image, place)) if kind.is_texel_buffer() => {
                self.report.keep(check_format(entry, image, place))?;
                Some(Resource::TexelBuffer(image.clone()))
            }
            (kind, found) => {
                let (what, place) = match found {
                    Found::Buffer(_, place) => ("a buffer", place),
                    Found::Image(_, place) => ("an image", place),
                    Found::Texels(_, place) => ("a texel buffer with its own texels", place),
                };
                let wanted = match kind {
                    kind if kind.is_buffer() => "a buffer",
                    kind if kind.is_image() => "an image",
                    _ => "another texel buffer",
                };
                let message = format!("`{}` is {what}, but this is a view of {wanted}", entry.of.value);
                self.report.push(entry.of.span.error(message).at_with(place.clone(), "declared here"));
                None
            }
        }
    }

    /// What a view names; nothing where that has mistakes of its own.
    fn viewed<'v>(&self, name: &Spanned<String>, viewed: &'v Viewed<'_>) -> Result<Option<Found<'v>>> {
        if let Some(found) = viewed.unbound.iter().find(|one| one.name == name.value) {
            return Ok(Some(Found::Buffer(found.data.size()?, &found.place)));
        }
        if let Some(found) = viewed.bound.iter().find(|one| one.name == name.value) {
            let place = &found.place;
            return match &found.resource {
                Resource::StorageBuffer(data) | Resource::UniformBuffer(data) => {
                    Ok(Some(Found::Buffer(data.size()?, place)))
                }
                Resource::StorageImage(image)
                | Resource::SampledImage(image)
                | Resource::CombinedImageSampler(image, _) => Ok(Some(Found::Image(image, place))),
                Resource::TexelBuffer(image) => Ok(Some(Found::Texels(image, place))),
                _ => {
                    let message =
                        format!("`{}` has no memory: it is neither a buffer nor an image", name.value);
                    Err(name.span.error(message).at_with(place.clone(), "declared here"))
                }
            };
        }
        match self.resource_entries.get(&name.value) {
            Some(entry) => match &entry.content {
                Some(content) => match content.contents.first() {
                    Some(Content::View(view)) => {
                        let root = &view.of.value;
                        let message = format!("`{}` is itself a view of `{root}`", name.value);
                        let place = entry.name.span.place();
                        Err(name
                            .span
                            .error(message)
                            .at_with(place, "declared here")
                            .note(format!("name `{root}` instead; an `offset` is relative to its start")))
                    }
                    _ => Ok(None),
                },
                None => Ok(None),
            },
            None => {
                let names = || self.resource_entries.entries.iter().map(|entry| entry.name.value.as_str());
                let message = format!("no resource is named `{}`", name.value);
                Err(unknown_name(name, message, "no such name", names))
            }
        }
    }
}

/// The range of a buffer that a descriptor refers to.
fn range(
    name: &str,
    kind: DescriptorKind,
    entry: &RangeEntry,
    size: u64,
    place: &Place,
) -> Result<BufferView> {
    let of_buffer = |error: Error| error.at_with(place.clone(), format!("{size} bytes"));
    let value = |key: &Option<Spanned<u64>>| key.as_ref().map_or(0, |key| key.value);
    for key in [&entry.offset, &entry.dynamic_offset].into_iter().flatten() {
        if !key.value.is_multiple_of(Buffer::OFFSET_ALIGNMENT) {
            return Err(key.span.error(format!("{} is not a multiple of 4 bytes", key.value)).note(
                "devices require this or a larger alignment, at most 256 \
                 (minStorageBufferOffsetAlignment, minUniformBufferOffsetAlignment)",
            ));
        }
    }
    let offset = value(&entry.offset);
    if let Some(key) = entry.offset.as_ref().filter(|_| offset >= size) {
        let message = format!("offset {offset} is past the end of `{name}`, which has {size} bytes");
        return Err(of_buffer(key.span.error(message).note("VUID-VkDescriptorBufferInfo-offset-00340")));
    }
    let rest = size - offset;
    let range = entry.range.as_ref().map_or(rest, |range| range.value);
    if let Some(key) = entry.range.as_ref().filter(|_| range == 0 || range > rest) {
        let (message, rule) = match range {
            0 => ("the range is empty".to_owned(), "VUID-VkDescriptorBufferInfo-range-00341"),
            _ => (
                format!(
                    "{range} bytes at offset {offset} extend past the end of `{name}`, which has {size} \
                     bytes"
                ),
                "VUID-VkDescriptorBufferInfo-range-00342",
            ),
        };
        return Err(of_buffer(key.span.error(message).note(rule)));
    }
    let dynamic_offset = value(&entry.dynamic_offset);
    if let Some(key) = entry.dynamic_offset.as_ref().filter(|_| dynamic_offset > rest - range) {
        let sum = offset.saturating_add(dynamic_offset);
        return Err(of_buffer(match entry.range {
            None => key
                .span
                .error(
                    "a nonzero `dynamic_offset` requires a `range`: without one, the \
                range is the rest of the buffer",
                )
                .note("VUID-vkCmdBindDescriptorSets-pDescriptorSets-06715"),
            Some(_) => key
                .span
                .error(format!(
                    "{range} bytes at offset {offset} + {dynamic_offset} = {sum} extend past the end of \
                 `{name}`, which has {size} bytes"
                ))
                .note("VUID-vkCmdBindDescriptorSets-pDescriptorSets-01979"),
        }));
    }
    Ok(BufferView { kind, buffer: name.to_owned(), offset, range, dynamic_offset })
}

/// Checks that a view does not give its image another format.
fn check_format(entry: &ViewEntry, image: &ImageContent, place: &Place) -> Result<()> {
    let Some(Spanned { value: format, span }) = &entry.format else { return Ok(()) };
    if *format == image.format {
        return Ok(());
    }
    let name = Format::NAMES.iter().find(|(_, known)| *known == image.format).map_or("", |(name, _)| name);
    let message = format!("the view's format differs from the format `{name}` of `{}`", entry.of.value);
    Err(span
        .error(message)
        .at_with(place.clone(), "declared here")
        .note("images with a mutable format are not supported: leave out `format`"))
}
