//! Study of the advice: simulated plates of unknown steel are bent to their target by the advice and by four strategies
//! of a shop.
//!
//! The steel is the simulator's fibre model, and the advice has no access to it ([`hidden_plate`]). Press, die and
//! operator have the errors of a shop. A plate is bent until the gap under every template (board) plus its uncertainty
//! is within the limit, or until 60 strokes. A plate counts as bent too far if, once on the way, a gap of the true
//! plate exceeded the limit where the plate is more hollow than the template.
//!
//! Limits: the model has one dimension. The bend is the same everywhere along a bend line; the weight of the plate and
//! the tilt of the ram are left out.

#[cfg(test)]
mod crews;
mod hidden_plate;
#[cfg(test)]
mod strain;
mod strategies;

use platen_advice::learner::like_plates;
use platen_host::cli::bench::BenchArguments;
use platen_host::cli::{CliError, output};
use platen_host::progress;
use platen_model::LikePlates;
use serde::Serialize;
use serde_json::{Value as Json, json};

use crate::seeds::shared;
use hidden_plate::{Order, Shop};
use strategies::{Advised, DepthTable, Outcome, Strategy};

/// Number of plates from which the press is learned, before the plates that count.
const TAUGHT: u64 = 10;

/// Row of the study: plates of one order, a shop, a strategy.
struct Row {
    order: Order,
    shop: Shop,
    strategy: Strategy,
    plates: u64,
}

/// Figures of a row: one strategy on one shop.
#[derive(Debug, Clone, Serialize)]
struct Figures {
    order: String,
    shop: String,
    strategy: String,
    plates: usize,
    strokes_mean: f64,
    strokes_median: usize,
    strokes_90: usize,
    strokes_max: usize,
    plates_too_far: usize,
    turned_over: usize,
    unfinished: usize,
    gap_end_mean_mm: f64,
    gap_end_max_mm: f64,
    /// Shares of measured angles and of gaps inside the stated 95 % intervals; `None` without advice.
    angle_inside: Option<f64>,
    gap_inside: Option<f64>,
    /// Share of the strokes for which nothing was advised.
    not_advised: Option<f64>,
    /// Plates on which the advice stated that the press is too coarse.
    said_too_coarse: Option<usize>,
    /// Plates on which the first stroke deviated so much that the advice requested a check of plate and die, and share
    /// of the third strokes inside their interval.
    said_look: Option<usize>,
    third_inside: Option<f64>,
    advise_ms: Option<f64>,
}

pub(super) fn study(arguments: &BenchArguments, json: bool) -> Result<Json, CliError> {
    let n = arguments.plates;
    let few = (2 * n).div_ceil(5);
    let (usual, shop) = (Order::cylinder(3.0, 9.0), Shop::default());
    let advice = Strategy::Advice(Advised::default());
    let mut rows = Vec::new();
    let mut add = |order: &Order, shop: &Shop, strategy, plates| {
        rows.push(Row { order: order.clone(), shop: shop.clone(), strategy, plates });
    };
    for strategy in Strategy::of_shops() {
        add(&usual, &shop, strategy, n);
    }
    for feed in [0.2, 0.3, 0.5] {
        add(&usual, &shop, Strategy::Advice(Advised { feed, ..Advised::default() }), n);
    }
    for order in Order::others() {
        add(&order, &shop, Strategy::ByHand, few);
        add(&order, &shop, advice, few);
    }
    for strategy in Strategy::parts() {
        add(&usual, &shop, strategy, few);
    }
    for shop in Shop::worse() {
        add(&usual, &shop, Strategy::ByHand, few);
        add(&usual, &shop, advice, few);
    }
    for shop in Shop::wrong_files() {
        add(&usual, &shop, Strategy::ByHand, few);
        add(&usual, &shop, Strategy::Advice(Advised { like: false, ..Advised::default() }), few);
    }
    let table = DepthTable::new();
    let mut all = Vec::new();
    for (k, row) in rows.iter().enumerate() {
        progress::share("advice", k as f64 / rows.len() as f64);
        all.push(figures(row, &table, arguments.seed, arguments.threads)?);
    }
    progress::done();
    if !json {
        print(&all)?;
    }
    Ok(json!(all))
}

/// Bends the plates of a row. The press is learned from the first plates, if the strategy learns.
fn figures(row: &Row, table: &DepthTable, seed: u64, threads: usize) -> Result<Figures, CliError> {
    let Row { order, shop, strategy, plates } = row;
    let seed = seed.wrapping_mul(1_000_003);
    let bend = |seed, like: Option<&LikePlates>| strategies::bend(*strategy, order, shop, seed, table, like);
    let mut models = Vec::new();
    if matches!(strategy, Strategy::Advice(_)) {
        for k in 0..TAUGHT {
            let like = like_plates(&strategies::law(), &models);
            models.extend(bend(seed.wrapping_sub(1 + k), like.as_ref()).model);
        }
    }
    let like = like_plates(&strategies::law(), &models);
    let seeds: Vec<u64> = (0..*plates).map(|k| seed.wrapping_add(k)).collect();
    let outcomes = shared(&seeds, threads, || Ok(()), |(), seed| Ok(bend(*seed, like.as_ref())))?;
    Ok(Figures::new(row, &outcomes))
}

impl Figures {
    fn new(row: &Row, outcomes: &[Outcome]) -> Self {
        let mut strokes: Vec<usize> = outcomes.iter().map(|it| it.strokes).collect();
        strokes.sort_unstable();
        let n = outcomes.len();
        let count = |what: fn(&Outcome) -> bool| outcomes.iter().filter(|it| what(it)).count();
        let advised = matches!(row.strategy, Strategy::Advice(_));
        let made: usize = strokes.iter().sum();
        let inside = |k: usize| {
            let [inside, all] = outcomes
                .iter()
                .fold([0, 0], |[inside, all], it| [inside + it.inside[k].0, all + it.inside[k].1]);
            (all > 0).then(|| inside as f64 / all as f64)
        };
        let gaps = || outcomes.iter().map(|it| 1e3 * it.gap);
        let advise_ms: f64 = outcomes.iter().map(|it| 1e3 * it.advise.as_secs_f64()).sum();
        Self {
            order: row.order.name.clone(),
            shop: row.shop.name.clone(),
            strategy: row.strategy.name(),
            plates: n,
            strokes_mean: made as f64 / n as f64,
            strokes_median: strokes[n / 2],
            strokes_90: strokes[(9 * n / 10).min(n - 1)],
            strokes_max: strokes[n - 1],
            plates_too_far: count(|it| it.too_far),
            turned_over: outcomes.iter().map(|it| it.turned_over).sum(),
            unfinished: count(|it| !it.finished),
            gap_end_mean_mm: gaps().sum::<f64>() / n as f64,
            gap_end_max_mm: gaps().fold(0.0, f64::max),
            angle_inside: inside(0),
            gap_inside: inside(1),
            not_advised: advised
                .then(|| outcomes.iter().map(|it| it.not_advised).sum::<usize>() as f64 / made as f64),
            said_too_coarse: advised.then(|| count(|it| it.said_too_coarse)),
            said_look: advised.then(|| count(|it| it.said_look)),
            third_inside: inside(2),
            advise_ms: advised.then(|| advise_ms / made as f64),
        }
    }

    fn row(&self) -> Vec<String> {
        let share = |it: Option<f64>| it.map_or_else(String::new, |it| format!("{:.0} %", 100.0 * it));
        vec![
            self.strategy.clone(),
            self.plates.to_string(),
            format!(
                "{:.1} / {} / {} / {}",
                self.strokes_mean, self.strokes_median, self.strokes_90, self.strokes_max
            ),
            self.plates_too_far.to_string(),
            self.turned_over.to_string(),
            self.unfinished.to_string(),
            format!("{:.2} / {:.1}", self.gap_end_mean_mm, self.gap_end_max_mm),
            share(self.angle_inside),
            share(self.gap_inside),
            share(self.not_advised),
            self.said_too_coarse.map_or_else(String::new, |it| it.to_string()),
            self.said_look.map_or_else(String::new, |it| it.to_string()),
            share(self.third_inside),
        ]
    }
}

/// Prints one table for each order and shop.
fn print(all: &[Figures]) -> Result<(), CliError> {
    let head = [
        "strategy",
        "plates",
        "strokes mean / median / 90 % / max",
        "too far",
        "turned over",
        "unfinished",
        "gap at the end mm",
        "angle inside",
        "gap inside",
        "not advised",
        "too coarse",
        "look at plate",
        "third inside",
    ];
    let mut from = 0;
    while from < all.len() {
        let of = (&all[from].order, &all[from].shop);
        let to = (from..all.len()).find(|k| (&all[*k].order, &all[*k].shop) != of).unwrap_or(all.len());
        let rows =
            std::iter::once(head.map(str::to_owned).to_vec()).chain(all[from..to].iter().map(Figures::row));
        output::titled(&format!("{}; {}", of.0, of.1), rows)?;
        from = to;
    }
    Ok(())
}
