//! Concurrent execution of two functions, each on one thread, with the results of sequential execution.

use std::panic::resume_unwind;
use std::thread;

/// Runs two functions, the first one on a separate thread if the system provides one, and returns both results.
pub fn join<A: Send, B>(first: impl Fn() -> A + Sync, second: impl FnOnce() -> B) -> (A, B) {
    thread::scope(|scope| {
        let other = thread::Builder::new().spawn_scoped(scope, &first);
        let second = second();
        let first = match other {
            Ok(other) => other.join().unwrap_or_else(|panic| resume_unwind(panic)),
            Err(_) => first(),
        };
        (first, second)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_results_come_back_in_their_places() {
        let values = [1, 2, 3];
        assert_eq!(join(|| values.iter().sum::<i32>(), || values.len()), (6, 3));
    }

    #[test]
    fn a_panic_of_the_first_is_that_of_the_caller() {
        let caught = std::panic::catch_unwind(|| join(|| resume_unwind(Box::new("first")), || ()));
        assert_eq!(caught.map(|((), ())| ()).unwrap_err().downcast_ref(), Some(&"first"));
    }
}
