//! A page in HTML about a picture: its pixels with their explanations, heat maps to lay over it,
//! and another picture to compare it with.
//!
//! The page is one file, which asks no network for anything and works from a disk. All that it
//! shows stands in it as JSON, in an element of its own; the page's script writes it as text, never
//! as HTML. Texts and planes of numbers are compressed (zlib), which browsers undo by themselves.

use std::io::Write;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use flate2::Compression;
use flate2::write::ZlibEncoder;
use serde::Serialize;

use crate::drawing::heat_map::{HeatMap, HeatScale};
use anyhit_base::error::Result;
use anyhit_base::escape;
use anyhit_scene::image::Rgba8;

const BODY: &str = include_str!("page/body.html");
const STYLE: &str = include_str!("page/style.css");
const SCRIPT: &str = include_str!("page/script.js");

/// Planes of more numbers than this are shown as colours only.
const MAX_NUMBERS: usize = 1 << 20;

/// The colours of a heat map's legend.
const LEGEND_COLOURS: u32 = 32;

/// What a page shows.
#[derive(Clone, Debug, Serialize)]
pub struct HtmlPage {
    /// The heading.
    pub title: String,
    /// Lines below it.
    pub facts: Vec<String>,
    /// Width and height of all pictures and heat maps.
    pub extent: [u32; 2],
    /// The invocations that the pixels stand for.
    pub invocations: PageInvocations,
    /// The pictures, shown side by side; heat maps are laid over the first. Without pictures, the
    /// heat maps are shown alone.
    pub pictures: Vec<PagePicture>,
    /// The heat maps.
    pub layers: Vec<PageLayer>,
    /// The layer that is shown at first, if it is not the picture.
    pub shown: Option<String>,
    /// The pixel that is selected at first.
    pub selected: Option<[u32; 2]>,
    /// What happened at some pixels.
    pub explanations: Option<PageExplanations>,
    /// The command that explains an invocation, without its ID: what is before and behind it.
    pub command: Option<[String; 2]>,
}

/// Mapping from the pixels of a page to invocations.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct PageInvocations {
    /// Name of an invocation: `pixel` or `invocation`.
    pub word: &'static str,
    /// Invocations along x, y and z.
    pub size: [u32; 3],
    /// Number of invocations, in launch order, from a pixel to the one below it.
    pub stride: u32,
    /// Number of components of an ID on the command line.
    pub dimensions: usize,
}

/// A picture of a page.
#[derive(Clone, Debug, Serialize)]
pub struct PagePicture {
    /// What it is.
    pub name: String,
    png: String,
    /// The pixels as functions of numbers, which exposure multiplies; `None` for a drawing.
    encoding: Option<NumberEncoding>,
    floats: Option<PageFloats>,
}

/// Encoding of the numbers of an image as pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum NumberEncoding {
    /// Encoded as sRGB.
    Srgb,
    /// Unchanged, 1 as 255.
    Stored,
}

/// The numbers of an image of floats.
#[derive(Clone, Debug, Serialize)]
struct PageFloats {
    /// Numbers of a pixel.
    channels: u8,
    /// The numbers as f32, compressed: first the lowest bytes of all of them, the highest last.
    values: String,
}

/// A heat map of a page.
#[derive(Clone, Debug, Serialize)]
pub struct PageLayer {
    /// Its name.
    pub name: String,
    /// What its numbers are.
    pub title: String,
    /// Lines about all of its numbers.
    pub facts: Vec<String>,
    /// The pixels with the greatest numbers, and these.
    pub worst: Vec<([u32; 2], f64)>,
    /// The number of other pixels with the same number as the last one.
    pub ties: usize,
    png: String,
    /// Colours from the first to the last.
    legend: Vec<String>,
    /// Numbers below the legend.
    ticks: Vec<f64>,
    /// The numbers as f32, little-endian; `None` for too many of them.
    values: Option<String>,
}

/// Explanations of pixels, compressed.
#[derive(Clone, Debug, Serialize)]
pub struct PageExplanations {
    /// How many there are.
    pub count: usize,
    /// The pixels that are explained.
    pub pixels: Vec<[u32; 2]>,
    /// In words which pixels these are.
    pub which: String,
    /// A JSON array of the texts.
    texts: String,
}

impl PagePicture {
    /// A picture under a name.
    ///
    /// # Errors
    /// As [`Rgba8::encode_png`].
    pub fn new(name: &str, picture: &Rgba8) -> Result<Self> {
        Ok(Self { name: name.to_owned(), png: png_address(picture)?, encoding: None, floats: None })
    }

    /// Sets how numbers became its pixels, so that the page can show them at another exposure.
    #[must_use]
    pub fn encoded(self, encoding: NumberEncoding) -> Self {
        Self { encoding: Some(encoding), ..self }
    }

    /// Adds the numbers of an image of floats, so many for each pixel, rows from the top. Too many
    /// for a page are left out.
    #[must_use]
    pub fn with_floats(self, channels: u8, values: &[f32]) -> Self {
        let pixels = values.len() / usize::from(channels.max(1));
        let floats = (pixels <= MAX_NUMBERS).then(|| PageFloats {
            channels,
            // Neighbours have similar high bytes: by themselves they are compressed best.
            values: compressed(&byte_planes(values)),
        });
        Self { floats, ..self }
    }
}

impl PageLayer {
    /// A heat map under a name and a title.
    ///
    /// # Errors
    /// As [`Rgba8::encode_png`].
    pub fn new(name: &str, title: &str, map: &HeatMap<'_>) -> Result<Self> {
        let at = |step: u32, steps: u32| f64::from(step) / f64::from(steps);
        let css = |[r, g, b]: [u8; 3]| format!("rgb({r} {g} {b})");
        let steps = match map.scale {
            HeatScale::Linear => 4,
            HeatScale::Logarithmic => 5,
        };
        Ok(Self {
            name: name.to_owned(),
            title: title.to_owned(),
            facts: Vec::new(),
            worst: Vec::new(),
            ties: 0,
            png: png_address(&map.plane())?,
            legend: (0..LEGEND_COLOURS)
                .map(|step| css(map.palette.colour(at(step, LEGEND_COLOURS - 1))))
                .collect(),
            ticks: (0..=steps).map(|step| map.value_at(at(step, steps))).collect(),
            values: (map.values.len() <= MAX_NUMBERS).then(|| compressed(&bytes_of(map.values))),
        })
    }
}

impl PageExplanations {
    /// The texts of pixels.
    pub fn new(explained: &[([u32; 2], String)], which: String) -> Self {
        let texts: Vec<&str> = explained.iter().map(|(_, text)| text.as_str()).collect();
        Self {
            count: explained.len(),
            pixels: explained.iter().map(|(pixel, _)| *pixel).collect(),
            which,
            texts: compressed(serde_json::json!(texts).to_string().as_bytes()),
        }
    }
}

impl HtmlPage {
    /// The page as HTML.
    pub fn html(&self) -> String {
        let data = serde_json::to_value(self).unwrap_or_default().to_string();
        let (title, data) = (escape::markup(&self.title), inside_script(&data));
        format!(
            "<!DOCTYPE html>\n\
             <html lang=\"en\">\n\
             <head>\n\
             <meta charset=\"utf-8\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
             <meta name=\"color-scheme\" content=\"light dark\">\n\
             <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; \
             img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'\">\n\
             <title>{title}</title>\n\
             <style>\n{STYLE}</style>\n\
             </head>\n\
             <body>\n{BODY}\
             <script type=\"application/json\" id=\"data\">{data}</script>\n\
             <script>\n{SCRIPT}</script>\n\
             </body>\n\
             </html>\n"
        )
    }
}

/// Numbers as f32, little-endian.
fn bytes_of(values: &[f64]) -> Vec<u8> {
    values.iter().flat_map(|&value| (value as f32).to_le_bytes()).collect()
}

/// The lowest bytes of all numbers as f32, then the next ones, up to the highest.
fn byte_planes(values: &[f32]) -> Vec<u8> {
    (0..4).flat_map(|byte| values.iter().map(move |value| value.to_le_bytes()[byte])).collect()
}

/// A PNG as the address of an image.
fn png_address(picture: &Rgba8) -> Result<String> {
    Ok(format!("data:image/png;base64,{}", STANDARD.encode(picture.encode_png()?)))
}

/// Bytes as the Base64 of their zlib stream.
fn compressed(bytes: &[u8]) -> String {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
    // Writing to a vector does not fail.
    let stream = encoder.write_all(bytes).and_then(|()| encoder.finish()).unwrap_or_default();
    STANDARD.encode(stream)
}

/// JSON in a script element, which no `</script>` or `<!--` of a text may end.
fn inside_script(json: &str) -> String {
    json.replace('<', "\\u003c")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bytes_of_floats_are_sorted_by_their_weight() {
        // 1.0 is 0x3F800000, -2.5 is 0xC0200000.
        assert_eq!(byte_planes(&[1.0, -2.5]), [0, 0, 0, 0, 0x80, 0x20, 0x3F, 0xC0]);
    }

    #[test]
    fn no_text_gets_out_of_its_element() {
        let nasty = "</script></title><!-- <script>alert(1)</script> & \u{2028}";
        let picture = Rgba8 { extent: [1, 1], pixels: vec![0; 4] };
        let page = HtmlPage {
            title: nasty.to_owned(),
            facts: vec![nasty.to_owned()],
            extent: [1, 1],
            invocations: PageInvocations { word: "pixel", size: [1; 3], stride: 1, dimensions: 2 },
            pictures: vec![PagePicture::new(nasty, &picture).expect("a PNG")],
            layers: Vec::new(),
            shown: None,
            selected: None,
            explanations: Some(PageExplanations::new(&[([0, 0], nasty.to_owned())], nasty.to_owned())),
            command: Some([nasty.to_owned(), nasty.to_owned()]),
        };
        let html = page.html();
        assert_eq!(html.matches("<script").count(), 2, "{html}");
        assert_eq!(html.matches("</script>").count(), 2);
        assert_eq!(html.matches("</title>").count(), 1);
        assert!(!html.contains("<!--"));
        let (_, rest) = html.split_once("id=\"data\">").expect("the data");
        let (data, _) = rest.split_once("</script>").expect("the end of the data");
        let data: serde_json::Value = serde_json::from_str(data).expect("JSON");
        assert_eq!(data["title"], nasty);
        assert_eq!(data["command"][1], nasty);
    }
}
