//! One case of a run: a scene, how it is rendered, and what watching it finds.

use std::error::Error;
use std::ops::ControlFlow;

use rayset_engine::{
    Backend, Coherent, EyeRays, PixelOrder, RenderError, RenderOptions, SweepLength, render_observed,
};

use super::compared::{Compared, Pair, pairs};
use super::dice::Dice;
use super::directed::{Brush, strew};
use super::families::Family;
use super::specimen::Specimen;
use super::watch::{Findings, Watched};

/// How many scenes, or sweeps, make a case of rays that are no image.
const N_DIRECTED: usize = 2000;

/// A strategy, changed: a mutation.
pub(crate) type Change<'a> = &'a (dyn for<'s> Fn(Coherent<'s>) -> Coherent<'s> + Sync);

/// Which case, and whether to go on.
#[derive(Clone, Copy)]
pub(crate) struct Case<'a> {
    pub(crate) seed: u64,
    pub(crate) number: u64,
    pub(crate) change: Change<'a>,
    /// Whether to stop at the first wrong answer.
    pub(crate) to_first: bool,
    /// Asked now and then whether to stop.
    pub(crate) is_stopped: &'a (dyn Fn() -> bool + Sync),
}

impl Case<'_> {
    /// The families take turns.
    pub(crate) fn family(&self) -> Family {
        let n = Family::ALL.len() as u64;
        Family::ALL[usize::try_from(self.number % n).expect("few families")]
    }

    /// Renders the scene of the case, or asks its rays.
    pub(crate) fn run(&self) -> Result<Findings, Box<dyn Error + Send + Sync>> {
        let mut dice = Dice::new(self.seed, self.number);
        let mut findings = match self.family() {
            Family::Brushing => self.brush(&mut dice)?,
            Family::Strewn => self.strew(&mut dice)?,
            family => self.image(&family.specimen(&mut dice)?, &mut dice)?,
        };
        if let Some(violation) = &mut findings.first {
            let (family, seed, number) = (self.family().name(), self.seed, self.number);
            violation.message = format!("{family}: --seed {seed} --case {number}\n{}", violation.message);
        }
        Ok(findings)
    }

    fn image(&self, specimen: &Specimen, dice: &mut Dice) -> Result<Findings, Box<dyn Error + Send + Sync>> {
        let backend = dice.pick(Backend::available());
        // Mostly rays of a sweep are few, so that savings are no use to them: then all must be free.
        let is_unlimited = !dice.once_in(4);
        let strategy = Coherent::on(&specimen.scene, backend);
        let strategy = if is_unlimited { strategy.unlimited() } else { strategy };
        let watched = Watched::new((self.change)(strategy), specimen);
        let width = dice.pick(&[64, 128, 256, 512]);
        let options = RenderOptions {
            width,
            height: (16_384 / width).min(64),
            max_depth: 5,
            cutoff: dice.pick(&[None, Some(1.0 / 256.0)]),
            order: Some(dice.pick(&[
                PixelOrder::Scanline,
                PixelOrder::Scanline,
                PixelOrder::Serpentine,
                PixelOrder::Tiles(4),
                PixelOrder::Morton(16),
            ])),
            sweep: dice.pick(&[SweepLength::Rows(8), SweepLength::Rows(16), SweepLength::WholeImage]),
            bundle_len: Some(dice.pick(&[1, 7, 64, 1 << 16])),
            eye_rays: dice.pick(&[EyeRays::default(), EyeRays::default(), EyeRays::Corners]),
            ..RenderOptions::default()
        };
        let observer = |_| match (self.is_stopped)() || self.to_first && watched.is_wrong() {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        };
        match render_observed(&watched, &options, &observer) {
            Ok(_) | Err(RenderError::Cancelled) => {}
            Err(error) => return Err(error.into()),
        }
        let mut findings = watched.findings();
        self.compare(&pairs(), specimen, &mut findings, |compared| compared.render(&options))?;
        if let Some(violation) = &mut findings.first {
            let scene = &specimen.scene;
            let (n_primitives, n_volumes) = (scene.n_primitives(), scene.volumes().len());
            violation.message = format!(
                "{n_primitives} primitives, {n_volumes} volumes, {backend}, {}limited, {options:?}\n{}{}",
                if is_unlimited { "un" } else { "" },
                violation.message,
                listed(specimen)
            );
        }
        Ok(findings)
    }

    fn brush(&self, dice: &mut Dice) -> Result<Findings, Box<dyn Error + Send + Sync>> {
        let (mut all, pairs) = (Findings::default(), pairs());
        for i in 0..N_DIRECTED {
            let brush = Brush::new(dice)?;
            let strategy = Coherent::on(&brush.specimen.scene, dice.pick(Backend::available())).unlimited();
            let watched = Watched::new((self.change)(strategy), &brush.specimen);
            brush.ask(&watched);
            let mut findings = watched.findings();
            // The strategies take turns.
            self.compare(&[pairs[i % pairs.len()]], &brush.specimen, &mut findings, |compared| {
                brush.ask(compared);
                Ok(())
            })?;
            if self.add(&mut all, findings, &brush.specimen) {
                break;
            }
        }
        Ok(all)
    }

    fn strew(&self, dice: &mut Dice) -> Result<Findings, Box<dyn Error + Send + Sync>> {
        let (mut all, pairs) = (Findings::default(), pairs());
        let family = dice.pick(&[Family::Spheres, Family::Touching, Family::Lattice, Family::Kinds]);
        let specimen = family.specimen(dice)?;
        for i in 0..N_DIRECTED {
            let strategy = Coherent::on(&specimen.scene, dice.pick(Backend::available())).unlimited();
            let watched = Watched::new((self.change)(strategy), &specimen);
            let mut same = dice.clone();
            strew(&watched, &specimen, dice);
            let mut findings = watched.findings();
            self.compare(&[pairs[i % pairs.len()]], &specimen, &mut findings, |compared| {
                strew(compared, &specimen, &mut same);
                Ok(())
            })?;
            if self.add(&mut all, findings, &specimen) {
                break;
            }
        }
        Ok(all)
    }

    /// Asks strategies on backends, and compares what they answer; not where one of them was changed.
    fn compare(
        &self,
        pairs: &[Pair],
        specimen: &Specimen,
        findings: &mut Findings,
        mut ask: impl FnMut(&Compared<'_>) -> Result<(), Box<dyn Error + Send + Sync>>,
    ) -> Result<(), Box<dyn Error + Send + Sync>> {
        if self.to_first {
            return Ok(());
        }
        for &pair in pairs {
            if (self.is_stopped)() {
                break;
            }
            let compared = Compared::new(pair, specimen);
            ask(&compared)?;
            let violation = compared.finish(&mut findings.comparisons);
            findings.first = findings.first.take().or(violation);
        }
        Ok(())
    }

    /// Adds what one sweep of rays gave; says whether to stop.
    fn add(&self, all: &mut Findings, mut found: Findings, specimen: &Specimen) -> bool {
        let checked = all.tallies.total().checked;
        // One sweep comes after another, though their ray-sets do not: the first violation stays.
        match &mut found.first {
            Some(violation) if all.first.is_none() => {
                violation.after += checked;
                violation.message = format!("{}{}", violation.message, listed(specimen));
            }
            first => *first = None,
        }
        all.absorb(found);
        (self.is_stopped)() || self.to_first && all.first.is_some()
    }
}

/// The primitives of a scene, if they are few.
fn listed(specimen: &Specimen) -> String {
    if specimen.primitives.len() > 12 {
        return String::new();
    }
    let primitives = specimen.primitives.iter().zip(0..);
    let lines = primitives.map(|((object, part), i)| {
        format!("\nprimitive {i} of object {}: {:?}, {:?}", object.0, part.primitive, part.sides)
    });
    lines.collect()
}
