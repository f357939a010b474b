//! `quarantine`: machines whose results were found wrong, in a data directory of this machine.

use super::{CliError, Global, json, maintenance::of_this_machine};
use murmuration_link::{errln, outln};
use murmuration_model::MachineId;
use murmuration_store::{DataDirectory, Store, StoreError};
use serde_json::json;

const EXAMPLES: &str = "\
Examples:
  murmuration quarantine                           lists them, also while a coordinator runs
  murmuration quarantine --lift 5f0c3a9e12d4b687   without its coordinator: start that again afterwards

What a machine did before it was found wrong is checked all the same.";

/// Arguments of `quarantine`.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct QuarantineCommand {
    /// Listen to this machine again: it was repaired, say
    #[arg(long, value_name = "MACHINE")]
    lift: Option<MachineId>,
}

impl QuarantineCommand {
    pub(super) fn execute(self, global: &Global) -> Result<(), CliError> {
        of_this_machine(global)?;
        match self.lift {
            Some(machine) => lift(global, machine),
            None => list(global),
        }
    }
}

fn list(global: &Global) -> Result<(), CliError> {
    let lock = DataDirectory::watch(&global.data);
    let alone = match &lock {
        Ok(_) => true,
        Err(StoreError::InUse { .. }) => false,
        Err(error) => return Err(CliError::Failed(error.to_string())),
    };
    let (store, _) = Store::look(&global.data, alone)?;
    let machines = store.still_quarantined()?;
    if global.json {
        let machines = machines
            .iter()
            .map(|wrong| json!({ "machine": wrong.machine.to_string(), "name": wrong.name }));
        json::print(&json!({ "schema": json::SCHEMA, "machines": machines.collect::<Vec<_>>() }))?;
        return Ok(());
    }
    for wrong in &machines {
        outln!("{}  {}", wrong.machine, wrong.name)?;
    }
    if machines.is_empty() {
        errln!("no machine is quarantined");
    }
    Ok(())
}

fn lift(global: &Global, machine: MachineId) -> Result<(), CliError> {
    let held = |error: StoreError| match error {
        StoreError::InUse { .. } => {
            CliError::busy(error, "stop that process first, and start it again afterwards")
        }
        error => error.into(),
    };
    // Held until it is lifted.
    let directory = DataDirectory::hold_existing(&global.data).map_err(held)?;
    let store = Store::open(&directory)?;
    if !store.lift_quarantine(machine)? {
        return Err(CliError::Input(format!(
            "machine {machine} is not quarantined; `murmuration quarantine` lists those that are"
        )));
    }
    if global.json {
        json::print(&json!({ "schema": json::SCHEMA, "lifted": machine.to_string() }))?;
    } else {
        errln!("machine {machine} is listened to again; next: murmuration serve");
    }
    Ok(())
}
