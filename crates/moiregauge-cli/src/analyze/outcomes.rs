//! Files → the analysis of every moiré, with the record of the run.

use moiregauge::campaign::{is_nothing_left, refusal};
use moiregauge_report::screen::failures;

use super::atomic::orientation;
use super::chain::{Outcome, analyse_files};
use super::survey::survey_image;
use super::task::Task;
use crate::{config, stripes};

/// Reads what is beside the scans, then these, and analyses them.
///
/// # Errors
/// Nothing could be analysed, or all of it is excluded.
pub(super) fn outcomes(task: &Task, loud: bool) -> anyhow::Result<Vec<Outcome>> {
    let survey = survey_image(task)?;
    let atomic = orientation(task)?;
    let mut settings = task.run.settings.clone();
    if let Some((found, _)) = &atomic {
        settings.lattice_angle = Some(found.known());
        config::check(&settings)?;
    }
    let wanted = task.run.report;
    let outcomes = analyse_files(
        &task.inputs,
        &task.run.sets,
        (&settings, &task.known),
        task.run.left_out.clone(),
        wanted.figures || wanted.png || wanted.html,
        loud,
    );
    let mut outcomes = outcomes.map_err(|failed| {
        eprint!("{}", failures(&failed));
        if let Some(stripes) = stripes::in_words(&task.inputs, &settings, &task.known) {
            eprintln!("{stripes}");
        }
        anyhow::anyhow!("nothing could be analysed")
    })?;
    let refused = outcomes.iter().find_map(|o| refusal(&o.analysis));
    if let Some(why) = refused.filter(|why| is_nothing_left(&why.doubt)) {
        anyhow::bail!("{}", why.message());
    }
    // The files are the same for all moirés.
    let mut record = None;
    for Outcome {
        analysis,
        provenance,
    } in &mut outcomes
    {
        if let Some((found, files)) = &atomic {
            analysis.caveats.extend(found.caveats.iter().cloned());
            analysis.atomic = Some(found.clone());
            provenance.inputs.extend(files.iter().cloned());
        }
        if let Some((picture, file)) = &survey {
            analysis.survey = Some(picture.clone());
            provenance.inputs.push(file.clone());
        }
        let record = record.get_or_insert_with(|| task.record(&provenance.inputs));
        provenance.run = Some(record.clone());
    }
    Ok(outcomes)
}
