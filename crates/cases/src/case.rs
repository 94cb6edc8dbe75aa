//! Cases: scenes with expectations, found in folders and run at several widths.

use std::path::{Path, PathBuf};

use crate::expect::{Difference, Expectations, Observed, OneRay};
use crate::run::{RayMeasurements, run, run_ray};
use crate::stability::perturb;
use anyhit_base::error::{Error, ErrorKind, Place, Result};
use anyhit_base::escape;
use anyhit_base::input::InputLimit;
use anyhit_base::sorted::{SortedSet, sort};
use anyhit_engine::pipeline::BatchWidth;
use anyhit_scene::file::SceneFile;
use anyhit_scene::read::{Diagnostics, Document, Parse, Table};
use anyhit_scene::resolve::refuse_module;
use anyhit_scene::{
    Assembled, Files, LoadOptions, ParsedScene, ResolvedScene, RunLimits, SceneFiles, assemble, load,
};

/// A scene, or one of its variants, that is to meet its expectations.
#[derive(Clone, Debug, PartialEq, Eq)]
#[must_use]
pub struct Case {
    /// The scene file.
    #[doc(hidden)]
    pub scene: PathBuf,
    /// The name of the variant.
    #[doc(hidden)]
    pub variant: Option<String>,
    /// The size of the launch, where it is not the scene's.
    #[doc(hidden)]
    pub size: Option<[u32; 2]>,
    /// Whether the launch is a test: that of a `scene.toml` is, unless it has rays that are tests
    /// and launches nothing; that of a `*.test.toml` where it has an `[expect]`.
    #[doc(hidden)]
    pub launch: bool,
    /// The rays that are tests of their own, because they have a `[ray.expect]`.
    #[doc(hidden)]
    pub rays: Vec<CaseRay>,
    /// How the scene and what it names are read.
    #[doc(hidden)]
    pub files: SceneFiles,
    /// The file, where it has several cases and no mistakes.
    #[doc(hidden)]
    pub parsed: Option<ParsedScene>,
}

/// A ray with a `[ray.expect]`, which the suite runs as a separate test.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CaseRay {
    /// Its place among the rays of its file.
    pub index: usize,
    /// Its name, or `ray N`.
    pub name: String,
    /// The line of its header, from 1.
    pub line: u32,
}

/// A case with everything that it names.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// The scene.
    pub scene: ResolvedScene,
    /// Its pipeline and resources.
    pub assembled: Assembled,
    /// `[expect]`
    pub expectations: Expectations,
    /// `[ray.expect]` of the file's own rays.
    pub rays: Vec<Option<OneRay>>,
}

/// What running a case at one width left behind.
#[derive(Clone, Debug)]
pub struct CaseRun {
    /// Everything that expectations look at.
    pub observed: Observed,
    /// The modules that were loaded.
    pub modules: Vec<PathBuf>,
}

/// The files beneath a folder that hold cases, in the order of their paths.
///
/// # Errors
/// `Io` where a folder cannot be read.
pub fn scenes(folder: &Path) -> Result<Vec<PathBuf>> {
    files_beneath(folder, &|path| {
        path.file_name().is_some_and(|name| name == "scene.toml") || is_test_file(path)
    })
}

/// The files beneath a folder that are wanted, in the order of their paths. Folders whose names
/// begin with a dot and those that a `CACHEDIR.TAG` marks are passed by.
///
/// # Errors
/// `Io` where a folder cannot be read.
pub fn files_beneath(folder: &Path, wanted: &dyn Fn(&Path) -> bool) -> Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    collect(folder, wanted, &mut files)?;
    sort(&mut files);
    Ok(files)
}

/// The files that were found already: one that is found through two paths counts once.
#[derive(Debug, Default)]
pub struct FoundFiles(SortedSet<PathBuf>);

impl FoundFiles {
    /// Adds a file; `false` where it was there.
    pub fn add(&mut self, file: &Path) -> bool {
        self.0.insert(file.canonicalize().unwrap_or_else(|_| file.to_path_buf()))
    }
}

fn collect(folder: &Path, wanted: &dyn Fn(&Path) -> bool, files: &mut Vec<PathBuf>) -> Result<()> {
    let entries = std::fs::read_dir(folder).map_err(|error| Error::io(folder, error))?;
    for entry in entries {
        let entry = entry.map_err(|error| Error::io(folder, error))?;
        let kind = entry.file_type().map_err(|error| Error::io(entry.path(), error))?;
        let path = entry.path();
        if kind.is_dir() {
            let is_hidden = entry.file_name().to_string_lossy().starts_with('.');
            if !is_hidden && !path.join("CACHEDIR.TAG").exists() {
                collect(&path, wanted, files)?;
            }
        } else if wanted(&path) {
            files.push(path);
        }
    }
    Ok(())
}

fn is_test_file(path: &Path) -> bool {
    path.file_name().is_some_and(|name| name.to_string_lossy().ends_with(".test.toml"))
}

impl Case {
    /// The cases beneath a folder, in the order of their paths: every `scene.toml` and
    /// `*.test.toml` with its variants. Folders whose names begin with a dot and those that a
    /// `CACHEDIR.TAG` marks are passed by.
    ///
    /// # Errors
    /// `Io` where a folder cannot be read, `InvalidArgument` where none has a case, and mistakes of
    /// scene files that are no TOML.
    pub fn discover(folder: &Path) -> Result<Vec<Self>> {
        let mut cases = Vec::new();
        for scene in scenes(folder)? {
            cases.extend(Self::of(&scene)?);
        }
        if cases.is_empty() {
            let message = format!("`{}` has no `scene.toml` and no `*.test.toml`", escape::path(folder));
            return Err(Error::new(ErrorKind::InvalidArgument, message)
                .note("pass a folder with cases: without any, nothing would be checked"));
        }
        Ok(cases)
    }

    /// The cases of one scene file: itself, then its variants.
    ///
    /// # Errors
    /// `Io` where the file cannot be read, `InvalidScene` where it is no scene.
    pub fn of(scene: &Path) -> Result<Vec<Self>> {
        Self::of_within(scene, &SceneFiles::default())
    }

    /// The cases of one scene file, which with all that it names is read in this way.
    ///
    /// # Errors
    /// As [`Case::of`].
    #[doc(hidden)]
    pub fn of_within(scene: &Path, files: &SceneFiles) -> Result<Vec<Self>> {
        let bytes = files.read_limited(scene, InputLimit::SceneBytes)?;
        refuse_module(scene, &bytes)?;
        let (text, is_utf8) = match String::from_utf8(bytes) {
            Ok(text) => (text, true),
            Err(error) => (String::from_utf8_lossy(error.as_bytes()).into_owned(), false),
        };
        // Mistakes other than of syntax are reported when the case is run.
        let report = Diagnostics::within(files.limits);
        let file = SceneFile::parse(scene, text.as_str(), &report)?;
        let is_shared = is_utf8 && !file.variants.all.is_empty();
        let parsed = is_shared.then(|| ParsedScene::keep(&file, &report)).flatten();
        let root = file.document.root(&report);
        let rays = each_ray(&file.document, &report, |at, table| {
            let name = table.value("name").and_then(|name| Some(escape::controls(name.text()?).into_owned()));
            table.has("expect").then(|| {
                let line = table.span().place().file_line().map_or(1, |(_, line)| line);
                CaseRay { index: at, name: name.unwrap_or_else(|| format!("ray {at}")), line }
            })
        });
        let pipeline = root.value("pipeline").and_then(Table::new);
        let launches = root.has("dispatch")
            || root.has("include")
            || pipeline.as_ref().is_some_and(|pipeline| pipeline.has("raygen"));
        drop(pipeline);
        // A scene whose rays are tests need not launch anything.
        let rests = rays.iter().any(Option::is_some) && !launches;
        let launch = root.has("expect") || !(is_test_file(scene) || rests);
        drop(root);
        let variants = file.variants.all.iter().map(|variant| Some(variant.name.value.clone()));
        let rays: Vec<_> = rays.into_iter().flatten().collect();
        let case = |variant| {
            let (rays, files, parsed) = (rays.clone(), files.clone(), parsed.clone());
            Self { scene: scene.to_path_buf(), variant, size: None, launch, rays, files, parsed }
        };
        Ok(std::iter::once(None).chain(variants).map(case).collect())
    }

    /// The scene's path beneath `root`, and the variant: `shaders/pass/arithmetic/basics (O0)`.
    #[must_use]
    pub fn name(&self, root: &Path) -> String {
        let folder = self.scene.parent().filter(|_| self.scene.ends_with("scene.toml"));
        let path = folder.map_or_else(|| self.scene.with_extension(""), Path::to_path_buf);
        let path = path.strip_prefix(root).unwrap_or(&path).to_string_lossy().replace('\\', "/");
        let path = escape::controls(&path);
        let path = path.strip_suffix(".test").unwrap_or(&path);
        match &self.variant {
            Some(variant) => format!("{path} ({variant})"),
            None => path.to_owned(),
        }
    }

    /// Loads the scene, runs it at 1, 64 and 128 lanes, and compares: the widths with each other
    /// bit for bit, then the result with `[expect]`, and each ray with its own.
    ///
    /// # Errors
    /// The mistakes of scene and shaders; `Expectation` for each difference.
    pub fn check(&self) -> Result<()> {
        self.run().map(drop)
    }

    /// Checks as [`Case::check`] does, and gives the run at 64 lanes.
    ///
    /// # Errors
    /// As [`Case::check`].
    #[doc(hidden)]
    pub fn run(&self) -> Result<CaseRun> {
        let loaded = self.load()?;
        let observed = loaded.widths()?;
        let mut differences = loaded.expectations.differences(&observed);
        for (at, expect) in loaded.rays.iter().enumerate() {
            let Some(expect) = expect else { continue };
            let (costs, stable) = (expect.rest.wants_costs(), expect.rest.stable.as_ref());
            let mut watch = RayMeasurements { costs, stable, ..RayMeasurements::default() };
            differences.extend(expect.differences(&run_ray(
                &loaded.scene,
                &loaded.assembled,
                at,
                &mut watch,
            )));
        }
        if !differences.is_empty() {
            return Err(Difference::as_error(differences));
        }
        let modules = loaded.scene.shaders.iter().map(|module| module.path.clone()).collect();
        Ok(CaseRun { observed, modules })
    }

    /// Loads the scene, runs it optimised and without any optimisation, and compares: see
    /// [`Loaded::check_launch`].
    ///
    /// # Errors
    /// The mistakes of scene and shaders; `Expectation` for the first difference.
    #[doc(hidden)]
    pub fn check_optimizer(&self) -> Result<()> {
        let loaded = self.load()?;
        loaded.check_launch(&run(&loaded.scene, &loaded.assembled, BatchWidth::default()))?;
        for at in (0..loaded.rays.len()).filter(|&at| loaded.rays[at].is_some()) {
            let found = run_ray(&loaded.scene, &loaded.assembled, at, &mut RayMeasurements::default());
            loaded.check_ray(at, &found)?;
        }
        Ok(())
    }

    /// Loads scene, shaders and expectations.
    ///
    /// # Errors
    /// All their mistakes.
    #[doc(hidden)]
    pub fn load(&self) -> Result<Loaded> {
        self.load_limited(&RunLimits::default())
    }

    /// Loads as [`Case::load`] does, with limits of running that go before the scene's own.
    ///
    /// # Errors
    /// All mistakes of the case.
    #[doc(hidden)]
    pub fn load_limited(&self, limits: &RunLimits) -> Result<Loaded> {
        let variant = self.variant.clone();
        let options =
            LoadOptions { size: self.size, variant, only_shaders_trace: true, ..LoadOptions::default() };
        let mut scene = match &self.parsed {
            Some(parsed) => parsed.load(&self.files, &options)?,
            None => load(&self.scene, &self.files, &options)?,
        };
        limits.give(&mut scene);
        let assembled = assemble(&scene)?;
        let mut expectations = Expectations::read(&scene.document)?;
        let report = Diagnostics::within(self.files.limits);
        let rays = each_ray(&scene.document, &report, |_, table| {
            table.has("expect").then(|| OneRay::parse(table.value("expect")?))
        });
        expectations.notes.extend(report.take_notes());
        report.finish()?;
        let mut rays: Vec<Option<OneRay>> = rays.into_iter().map(Option::flatten).collect();
        for one in rays.iter_mut().flatten().map(|ray| &mut ray.rest).chain([&mut expectations]) {
            one.read_with(&self.files);
        }
        Ok(Loaded { scene, assembled, expectations, rays })
    }
}

/// Reads something of each `[[ray]]` of a document.
fn each_ray<T>(document: &Document, report: &Diagnostics, read: impl Fn(usize, &Table<'_>) -> T) -> Vec<T> {
    let root = document.root(report);
    let rays = root.value("ray").and_then(|rays| rays.elements());
    let tables = rays.into_iter().flatten().filter_map(Table::new).enumerate();
    tables.map(|(at, table)| read(at, &table)).collect()
}

impl Loaded {
    /// Runs it at 1, 64 and 128 lanes: all three must agree bit for bit. Gives the run at 64 lanes.
    ///
    /// # Errors
    /// `Expectation` where they do not agree; what [`run::costs`](crate::run::costs) says.
    pub fn widths(&self) -> Result<Observed> {
        let (scene, assembled) = (&self.scene, &self.assembled);
        let [one, mut many, most] = BatchWidth::ALL.map(|width| run(scene, assembled, width));
        for (width, other) in [(BatchWidth::Of64, &many), (BatchWidth::Of128, &most)] {
            if let Some(difference) = difference(&one, other, Counts::All) {
                let message = format!("1 and {width} lanes disagree: {difference}");
                return Err(Error::new(ErrorKind::Expectation, message)
                    .at(Place::File(scene.path.clone()))
                    .note("results must not depend on how many invocations run side by side"));
            }
        }
        self.add_costs(&mut many)?;
        Ok(many)
    }

    /// Counts what rays cost and finds what depends on rounding, where an expectation needs it.
    ///
    /// # Errors
    /// As [`run::costs`](crate::run::costs).
    pub fn add_costs(&self, observed: &mut Observed) -> Result<()> {
        if let Some(stable) = self.expectations.stable.as_ref().filter(|_| observed.trap.is_none()) {
            observed.stability = Some(perturb(&self.scene, &self.assembled, &stable.perturbation));
        }
        if self.expectations.wants_costs() && observed.trap.is_none() {
            observed.costs = Some(crate::run::costs(&self.assembled)?);
        }
        Ok(())
    }
}

/// Which counts of two runs must be the same.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Counts {
    /// All that do not depend on the size of batches.
    All,
    /// Only those of rays: a shader that leaves nothing behind need not be called.
    Rays,
}

/// What differs between two runs of one case.
pub(super) fn difference<'a>(one: &'a Observed, other: &'a Observed, which: Counts) -> Option<String> {
    // Which limit stops a launch first, and what its invocations leave then, depends on how many
    // run side by side; whether the clock stops it, on the machine.
    let limit = |observed: &Observed| {
        let code = observed.trap.as_ref()?.trap()?.code;
        code.is_limit().then_some(code)
    };
    match [one, other].map(limit) {
        [Some(_), Some(_)] => return None,
        [Some(code), None] | [None, Some(code)] if code.is_of_clock() => return None,
        _ => {}
    }
    let trap = |observed: &Observed| observed.trap.as_ref().map(Error::render);
    if trap(one) != trap(other) {
        let words = |trap: Option<String>| trap.unwrap_or_else(|| "no trap".into());
        return Some(format!("{} / {}", words(trap(one)), words(trap(other))));
    }
    let data = |observed: &'a Observed| observed.trap.as_ref().and_then(Error::trap);
    if data(one) != data(other) {
        return Some(format!("{:?} / {:?}", data(one), data(other)));
    }
    let buffers = one.buffers.iter().zip(&other.buffers);
    let images = one.images.iter().zip(&other.images);
    for (one, other) in buffers.chain(images).filter(|(one, other)| one.differs(other)) {
        if let Some(at) = one.bytes().iter().zip(other.bytes()).position(|(one, other)| one != other) {
            let word = |bytes: &[u8]| {
                let word = bytes.get(at & !3..(at & !3) + 4).and_then(|word| word.try_into().ok());
                word.map_or(0, u32::from_le_bytes)
            };
            let (one_word, other_word) = (word(one.bytes()), word(other.bytes()));
            return Some(format!(
                "`{}` at byte {}: {one_word:#010x} / {other_word:#010x} (as floats {} / {})",
                one.name,
                at & !3,
                f32::from_bits(one_word),
                f32::from_bits(other_word)
            ));
        }
    }
    if one.printed != other.printed {
        let line = one.printed.lines().zip(other.printed.lines()).find(|(one, other)| one != other);
        let (one, other) = line.unwrap_or((&one.printed, &other.printed));
        return Some(format!("printed {one:?} / {other:?}"));
    }
    // Batches differ with the width, invocations do not.
    let counts = |observed: &Observed| {
        let stats = observed.stats.as_ref()?;
        Some((
            stats.rays,
            stats.ray_queries,
            stats.reorders,
            match which {
                Counts::All => stats.shaders.values().map(|stage| stage.invocations).collect::<Vec<_>>(),
                Counts::Rays => Vec::new(),
            },
        ))
    };
    (counts(one) != counts(other)).then(|| format!("counts {:?} / {:?}", counts(one), counts(other)))
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEAD: &str = "version = 1\n[shaders.main]\npath = \"main.spv\"\n[[dispatch]]\n\
        shader = \"main\"\ngroups = 1\n\
        [[variant]]\nname = \"a\"\nshaders.main = \"a.spv\"\n\
        [[variant]]\nname = \"b\"\nshaders.main = \"b.spv\"\n";

    /// The cases of a scene file, and its path.
    fn cases(folder: &Path, text: &str) -> (Vec<Case>, PathBuf) {
        let path = folder.join("scene.toml");
        std::fs::write(&path, text).expect("a file");
        let empty = [0x0723_0203_u32, 0x0001_0000, 0, 1, 0].map(u32::to_le_bytes).concat();
        for name in ["main.spv", "a.spv", "b.spv"] {
            std::fs::write(folder.join(name), &empty).expect("a file");
        }
        (Case::of(&path).expect("a scene"), path)
    }

    #[test]
    fn variants_are_loaded_from_one_reading_of_their_file() {
        let folder = tempfile::tempdir().expect("a folder");
        let (cases, path) = cases(folder.path(), HEAD);
        assert_eq!(cases.len(), 3);
        std::fs::remove_file(path).expect("the file");
        let paths = cases.iter().map(|case| {
            let parsed = case.parsed.as_ref().expect("a file without mistakes");
            let options = LoadOptions { variant: case.variant.clone(), ..LoadOptions::default() };
            let scene = parsed.load(&case.files, &options).expect("a scene");
            scene.shaders[0].path.file_name().expect("a name").to_owned()
        });
        assert_eq!(paths.collect::<Vec<_>>(), ["main.spv", "a.spv", "b.spv"]);
    }

    #[test]
    fn mistakes_are_those_of_reading_the_file_anew() {
        let mistakes = [
            ("[[variant]]\nname = \"c\"\nshaders.other = \"b.spv\"\n", "no shader `other` to replace"),
            ("[[variant]]\nname = \"b\"\n", "two variants are named `b`"),
            ("[[variant]]\nname = \"c\"\nshader.main = \"b.spv\"\n", "unknown key `shader`"),
            ("[[ray]]\npixel = [0]\n", "expected"),
        ];
        for (more, message) in mistakes {
            let folder = tempfile::tempdir().expect("a folder");
            let (cases, _) = cases(folder.path(), &format!("{HEAD}{more}"));
            let loads = |case: &Case| case.load().map(|_| ()).map_err(|error| error.render());
            let found: Vec<_> = cases.iter().map(loads).collect();
            let anew = cases.into_iter().map(|case| Case { parsed: None, ..case });
            assert_eq!(found, anew.map(|case| loads(&case)).collect::<Vec<_>>());
            let told = found.iter().filter_map(|one| one.as_ref().err());
            assert!(told.into_iter().any(|error| error.contains(message)), "{message}: {found:?}");
        }
    }
}
