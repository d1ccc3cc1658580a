//! The analysis of every moiré, with the record of the run.

use moiregauge::series::refusal;
use moiregauge_report::screen::failures;

use super::beside::Beside;
use super::chain::{Outcome, analyse_files};
use super::task::Task;
use crate::stripes;

/// Reads what is beside the scans, then these, and analyses them.
///
/// # Errors
/// Nothing could be analysed, or all of it is excluded.
pub(super) fn outcomes(task: &Task, loud: bool) -> anyhow::Result<Vec<Outcome>> {
    let beside = Beside::read(task)?;
    let settings = beside.settings(task.run.settings.clone())?;
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
    if let Some(why) = refused.filter(|why| why.code == "everything-excluded") {
        anyhow::bail!("{}", why.message);
    }
    // The files are the same for all moirés.
    let mut record = None;
    for outcome in &mut outcomes {
        beside.join(outcome);
        let provenance = &mut outcome.provenance;
        let record = record.get_or_insert_with(|| task.record(&provenance.inputs));
        provenance.run = Some(record.clone());
    }
    Ok(outcomes)
}
