//! `cargo xtask bless`: the only writer of goldens, snapshots, and figures in documents.

use std::fs;

use clap::ValueEnum;
use rayset::{ChannelNames, image_of};
use rayset_engine::{RenderOptions, StrategyKind, render};
use rayset_image::{to_srgb8, write_exr, write_png_rgb8};
use rayset_study::{Table1Plan, sphere_scene, write_file};

use crate::{Outcome, golden, instructions, project, repro_table1};

#[derive(clap::Args)]
#[command(after_help = "Examples:
  cargo xtask bless
  cargo xtask bless goldens snapshots

What is blessed is a commit of its own, which says why it changed.")]
pub(crate) struct Options {
    /// What to write; everything if nothing is named.
    what: Vec<What>,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum What {
    /// fixtures/golden/*.exr.
    Goldens,
    /// fixtures/golden/instructions.json; needs valgrind.
    Instructions,
    /// The text snapshots of the tests.
    Snapshots,
    /// docs/picture.png, which the README shows.
    Picture,
    /// docs/table1.md, docs/table1.svg and the table of the README: runs the whole experiment, for minutes.
    Table1,
}

pub(crate) fn run(options: &Options) -> Outcome {
    let wanted = |what| options.what.is_empty() || options.what.contains(&what);
    if wanted(What::Goldens) {
        for scene in golden::scenes()? {
            let frame = golden::frame(&scene, StrategyKind::Standard)?;
            let path = project::fixtures().join("golden").join(format!("{}.exr", scene.name));
            fs::create_dir_all(path.parent().expect("a folder"))?;
            write_exr(&path, &golden::image(&scene, &frame)?)?;
            println!("wrote {}", path.display());
        }
    }
    if wanted(What::Instructions) {
        instructions::bless()?;
    }
    if wanted(What::Snapshots) {
        let mut tests = project::cargo(&["test", "--workspace", "--test", "snapshots", "--test", "summary"]);
        project::run(tests.env("INSTA_UPDATE", "always"))?;
    }
    if wanted(What::Picture) {
        let scene = sphere_scene(8, 1)?;
        let options = RenderOptions { width: 480, height: 480, ..RenderOptions::default() };
        let frame = render(StrategyKind::Standard.bind(&scene.scene).as_ref(), &options)?;
        let image = image_of(&frame, ChannelNames::Plain, &[])?;
        let path = project::root().join("docs/picture.png");
        write_png_rgb8(&path, image.width(), image.height(), &to_srgb8(&image, 0.0)?)?;
        println!("wrote {}", path.display());
    }
    if wanted(What::Table1) {
        table1()?;
    }
    Ok(())
}

fn table1() -> Outcome {
    let table = repro_table1::measure(&Table1Plan::full(project::fixtures()))?;
    let out = project::root().join("target/repro/table1");
    table.write(&out)?;
    let docs = project::root().join("docs");
    let text = format!(
        "# Table 1, reproduced\n\nWritten by `cargo xtask bless table1`; `cargo xtask repro-table1` prints the same of the machine it runs on.\nCounts are exact; times are of one machine, and only their ratios mean something.\n\n![Ratio and coherence over the number of spheres](table1.svg)\n\n{}",
        table.to_markdown()
    );
    write_file(&docs.join("table1.md"), text.as_bytes())?;
    fs::copy(out.join("table1.svg"), docs.join("table1.svg"))?;
    println!("wrote {}", docs.join("table1.md").display());
    let readme = project::root().join("README.md");
    let text = fs::read_to_string(&readme)?;
    write_file(&readme, replace_marked(&text, "table1", &table.summary())?.as_bytes())?;
    println!("wrote the table of {}", readme.display());
    Ok(())
}

/// Replaces what stands between `<!-- NAME -->` and `<!-- /NAME -->`.
pub(crate) fn replace_marked(text: &str, name: &str, contents: &str) -> Result<String, String> {
    let (begin, end) = (format!("<!-- {name} -->\n"), format!("<!-- /{name} -->"));
    let missing = || format!("no `{}` ... `{end}` to write into", begin.trim());
    let (before, rest) = text.split_once(&begin).ok_or_else(missing)?;
    let (_, after) = rest.split_once(&end).ok_or_else(missing)?;
    Ok(format!("{before}{begin}{contents}{end}{after}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_is_marked_is_replaced() {
        let text = "a\n<!-- x -->\nold\n<!-- /x -->\nb\n";
        assert_eq!(replace_marked(text, "x", "new\n").unwrap(), "a\n<!-- x -->\nnew\n<!-- /x -->\nb\n");
        assert!(replace_marked("a", "x", "new").is_err());
    }
}
