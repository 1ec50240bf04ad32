//! Work for threads: lists cut into pieces, and two tasks side by side.

/// Runs both tasks, in parallel where that is worth it.
pub(crate) fn side_by_side<A: Send, B: Send>(
    is_worth_it: bool,
    a: impl FnOnce() -> A + Send,
    b: impl FnOnce() -> B + Send,
) -> (A, B) {
    if is_worth_it { rayon::join(a, b) } else { (a(), b()) }
}

/// Cuts a list into pieces of about this length, never between neighbours that belong together.
pub(crate) fn pieces<T>(
    mut list: &[T],
    length: usize,
    belong_together: impl Fn(&T, &T) -> bool,
) -> Vec<&[T]> {
    let length = length.max(1);
    let mut pieces = Vec::with_capacity(list.len() / length + 1);
    while list.len() > length {
        let pairs = list[length - 1..].windows(2);
        let more = pairs.take_while(|pair| belong_together(&pair[0], &pair[1])).count();
        let (piece, others) = list.split_at(length + more);
        pieces.push(piece);
        list = others;
    }
    if !list.is_empty() {
        pieces.push(list);
    }
    pieces
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_belongs_together_is_in_one_piece() {
        let list = [1, 1, 2, 2, 2, 2, 2, 3, 4, 5, 6, 6];
        let all = |length| pieces(&list, length, |a, b| a == b);
        assert_eq!(all(3), [&list[..7], &list[7..10], &list[10..]]);
        assert_eq!(all(2), [&list[..2], &list[2..7], &list[7..9], &list[9..12]]);
        assert_eq!(all(12), [&list[..]]);
        assert_eq!([all(1).concat(), all(0).concat()], [list; 2]);
        assert!(pieces(&[0; 0], 5, |a, b| a == b).is_empty());
    }
}
