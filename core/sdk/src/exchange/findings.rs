//! Documents of comparisons and advisors: a comparison's task, findings and fields; an advisor's history of the plate,
//! and its advice.

use std::ffi::CStr;

use platen_abi::payload::{self, Header};
use platen_model::{Advice, Field, Findings, NodeState, PlateHistory, Task};

use super::{Arrays, DecodeError, Payload};

/// Largest field accepted: 4 million numbers.
const MAX_FIELD: usize = 1 << 22;

/// Implements [`Payload`] as JSON without a header. These documents are plain data and always have a JSON form.
macro_rules! json {
    ($($document:ty = $format:expr;)*) => { $(
        impl Payload for $document {
            const FORMAT: &'static CStr = $format;

            fn encode<B: AsMut<[u8]>, E>(&self, allocate: impl FnOnce(usize) -> Result<B, E>) -> Result<B, E> {
                let text = serde_json::to_vec(self).unwrap_or_default();
                let mut buffer = allocate(text.len())?;
                buffer.as_mut().copy_from_slice(&text);
                Ok(buffer)
            }

            fn decode(bytes: &[u8]) -> Result<Self, DecodeError> {
                serde_json::from_slice(bytes).map_err(|error| {
                    let text = error.to_string().replace("invalid type: null, expected f64", "a number that is none (NaN or infinite)");
                    DecodeError::Invalid(text)
                })
            }
        }
    )* };
}

json! {
    Task = payload::TASK;
    Findings = payload::FINDINGS;
    PlateHistory = payload::RECORD;
    Advice = payload::ADVICE;
}

impl Payload for Field {
    const FORMAT: &'static CStr = payload::Grid::FORMAT;

    fn encode<B: AsMut<[u8]>, E>(&self, allocate: impl FnOnce(usize) -> Result<B, E>) -> Result<B, E> {
        let state: Vec<u8> = self.state.iter().map(|state| *state as u8).collect();
        let mut arrays = Arrays::behind::<payload::Grid>();
        let head = payload::Grid {
            struct_size: size_of::<payload::Grid>() as u32,
            reserved: 0,
            n_u: self.nodes[0] as u32,
            n_v: self.nodes[1] as u32,
            components: self.components as u32,
            reserved_2: 0,
            name: arrays.add(self.name.as_bytes()),
            unit: arrays.add(self.unit.as_bytes()),
            values: arrays.add(&self.values),
            state: arrays.add(&state),
        };
        arrays.encode(&head, allocate)
    }

    fn decode(bytes: &[u8]) -> Result<Self, DecodeError> {
        let head: payload::Grid = payload::read(bytes)?;
        let state = |code: &u8| match code {
            1 => NodeState::Seen,
            2 => NodeState::Unchanged,
            _ => NodeState::Unseen,
        };
        let field = Self {
            name: payload::text(bytes, head.name)?,
            unit: payload::text(bytes, head.unit)?,
            nodes: [head.n_u as usize, head.n_v as usize],
            components: head.components as usize,
            values: payload::slice::<f64>(bytes, head.values)?.to_vec(),
            state: payload::slice::<u8>(bytes, head.state)?.iter().map(state).collect(),
        };
        check(&field).map(|()| field)
    }
}

/// Refuses a field that does not fit its grid, or that has a value other than a finite number where it was seen.
pub(crate) fn check(field: &Field) -> Result<(), DecodeError> {
    let nodes = field.nodes[0].saturating_mul(field.nodes[1]);
    let numbers = nodes.saturating_mul(field.components);
    let fits =
        (1..=MAX_FIELD).contains(&numbers) && field.values.len() == numbers && field.state.len() == nodes;
    let known = |(i, value): (usize, &f64)| {
        value.is_finite() || field.state.get(i / field.components) == Some(&NodeState::Unseen)
    };
    if fits && field.values.iter().enumerate().all(known) {
        return Ok(());
    }
    Err(DecodeError::Invalid(format!("field {} does not fit its grid", field.name)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn field() -> Field {
        Field {
            name: "deviation".into(),
            unit: "m".into(),
            nodes: [3, 2],
            components: 1,
            values: vec![0.0, 0.5, -0.25, f64::NAN, 1.0, 2.0],
            state: vec![
                NodeState::Seen,
                NodeState::Unchanged,
                NodeState::Seen,
                NodeState::Unseen,
                NodeState::Seen,
                NodeState::Seen,
            ],
        }
    }

    #[test]
    fn a_field_is_read_as_it_was_written() {
        let read = Field::decode(field().to_buffer().as_ref()).unwrap();
        assert_eq!((read.name.as_str(), read.unit.as_str(), read.nodes), ("deviation", "m", [3, 2]));
        assert_eq!((&read.state, read.values[2]), (&field().state, -0.25));
        assert!(read.values[3].is_nan(), "a node that was not seen may hold anything");
    }

    #[test]
    fn a_field_that_does_not_fit_its_grid_is_refused() {
        let wrong = [
            Field { nodes: [2, 2], ..field() },
            Field { components: 0, ..field() },
            Field { values: vec![f64::NAN; 6], ..field() },
            Field { state: Vec::new(), ..field() },
        ];
        for field in wrong {
            let refused = Field::decode(field.to_buffer().as_ref()).unwrap_err().to_string();
            assert_eq!(refused, "field deviation does not fit its grid");
        }
    }
}
