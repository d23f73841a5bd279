//! A scenario's waiting subtasks: async functions, telling their devices the times of the answers.

use alloc::sync::Arc;
use alloc::vec::Vec;
use core::time::Duration;

use fass::shared::{Asker, DeviceDriver, create_device};
use fass::{Dag, SubtaskAttributes, sleep};

use crate::build::{Inputs, Outputs, Step};
use crate::dag::{SubtaskText, WaitText, of_call};

/// The device of a subtask. A question is the time until the answer.
pub type ScenarioDevice = DeviceDriver<Duration, ()>;

/// Registers a waiting subtask, and returns the device it asks.
pub(crate) fn register<I: Inputs + 'static, O: Outputs + 'static>(
    dag: &Dag,
    subtask: &SubtaskText,
    (inputs, outputs, attributes): (Vec<&str>, Vec<&str>, SubtaskAttributes),
    step: Arc<Step>,
) -> ScenarioDevice {
    let (device, driver) = create_device(&subtask.name);
    let waits: Arc<[WaitText]> = subtask.waits.clone().into();
    let call = move |asker: Asker<Duration, ()>, inputs: I| {
        // Each call's future has its own, without an allocation.
        let (step, waits) = (Arc::clone(&step), Arc::clone(&waits));
        async move {
            let call = step.begin();
            for wait in &*waits {
                match of_call(&wait.answered, call) {
                    None => sleep(wait.limit).await,
                    Some(after) => {
                        let answer = asker.ask(after).await;
                        let is_late = after > wait.limit;
                        assert!(!is_late || answer.is_err(), "an answer beyond the limit");
                    }
                }
                step.execute(&wait.takes, call);
            }
            step.end::<I, O>(call, inputs)
        }
    };
    let waiting = dag.using(device.asking()).async_subtask(call);
    let waiting = waiting.reads(&inputs).writes(&outputs);
    match subtask.due {
        Some(due) => waiting.due(due).register(attributes),
        None => waiting.register(attributes),
    }
    driver
}
