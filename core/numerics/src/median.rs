//! Median by selection, and the robust standard deviation computed from it.

/// Returns the upper median of the values; `None` when there are none.
pub fn median(mut values: Vec<f64>) -> Option<f64> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// Estimates the standard deviation of normal deviates with outliers from their absolute values (median absolute
/// deviation); `None` when there are none.
pub fn robust_deviation(sizes: Vec<f64>) -> Option<f64> {
    /// The median of |x| of the standard normal distribution.
    const MEDIAN: f64 = 0.674_489_750_196_081_7;
    median(sizes).map(|median| median / MEDIAN)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_an_even_number_it_is_the_upper_one() {
        assert_eq!(median(vec![3.0, -1.0, 2.0]), Some(2.0));
        assert_eq!(median(vec![4.0, 1.0, 3.0, 2.0]), Some(3.0));
        assert_eq!(median(Vec::new()), None);
    }

    #[test]
    fn outliers_hardly_move_the_robust_deviation() {
        // Quantiles of |x| of the standard normal distribution at 0.1, 0.3, 0.5, 0.7 and, instead of 0.9, an outlier.
        let found = robust_deviation(vec![0.125_66, 0.385_32, 0.674_49, 1.036_43, 1e9]);
        assert!(found.is_some_and(|deviation| (deviation - 1.0).abs() < 1e-5));
        assert_eq!(robust_deviation(Vec::new()), None);
    }
}
