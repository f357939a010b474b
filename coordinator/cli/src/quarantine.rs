//! `quarantine`: machines that returned wrong results, in a data directory of this machine.

use super::{
    CliError, Global, json,
    maintenance::of_this_machine,
    table::{Table, left},
};
use murmuration_link::errln;
use murmuration_model::MachineId;
use murmuration_store::{DataDirectory, Store, StoreError};

const EXAMPLES: &str = "\
Examples:
  murmuration quarantine                           list the machines, also while a coordinator runs
  murmuration quarantine --lift 5f0c3a9e12d4b687   stop the coordinator first, and start it again afterwards

The coordinator still checks the results that the machine returned before its quarantine.";

#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub struct QuarantineCommand {
    /// Accept this machine again, for example after a repair
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
    let lock = match DataDirectory::watch(&global.data) {
        Ok(lock) => Some(lock),
        Err(StoreError::InUse { .. }) => None,
        Err(error) => return Err(error.into()),
    };
    let (store, _) = Store::look(&global.data, lock.is_some())?;
    let machines = store.still_quarantined()?;
    if global.json {
        let machines = machines.iter();
        let machines = machines.map(|wrong| json::QuarantinedMachine::new(wrong.machine, &wrong.name));
        json::print(json::Quarantine {
            machines: machines.collect(),
        })?;
        return Ok(());
    }
    if machines.is_empty() {
        errln!("no machine is quarantined");
        return Ok(());
    }
    let mut table = Table::new([left("MACHINE"), left("NAME")]);
    for wrong in &machines {
        table.row([wrong.machine.to_string(), wrong.name.clone()]);
    }
    Ok(table.print()?)
}

fn lift(global: &Global, machine: MachineId) -> Result<(), CliError> {
    let held = |error: StoreError| match error {
        StoreError::InUse { .. } => {
            CliError::busy(error, "stop that process first, and start it again afterwards")
        }
        error => error.into(),
    };
    // The command holds the data directory until the quarantine is lifted.
    let directory = DataDirectory::take_over_existing(&global.data).map_err(held)?;
    // The next `serve --mirror` writes the whole database into the mirror.
    let store = Store::open_beside_mirror(&directory)?;
    if !store.lift_quarantine(machine)? {
        return Err(CliError::Input(format!(
            "machine {machine} is not quarantined: `murmuration quarantine` lists the machines that are"
        )));
    }
    if global.json {
        json::print(json::LiftedQuarantine {
            lifted: machine.to_string(),
        })?;
    } else {
        errln!("machine {machine} is accepted again; next: murmuration serve");
    }
    Ok(())
}
