//! Helpers that process long lists in parallel.

use rayon::prelude::*;

/// Maps a list, in parallel if it is long.
pub(super) fn map<T: Sync, R: Send>(list: &[T], long: usize, work: impl Fn(&T) -> R + Send + Sync) -> Vec<R> {
    if list.len() < long { list.iter().map(work).collect() } else { list.par_iter().map(work).collect() }
}

/// Maps a short list of large entries, in parallel if it has several.
pub(super) fn map_into<T: Send, R: Send>(list: Vec<T>, work: impl Fn(T) -> R + Send + Sync) -> Vec<R> {
    if list.len() < 2 {
        list.into_iter().map(work).collect()
    } else {
        list.into_par_iter().map(work).collect()
    }
}

/// Maps the numbers below `end`, in parallel if there are many.
pub(super) fn map_numbers<R: Send>(
    end: usize,
    many: usize,
    work: impl Fn(usize) -> R + Send + Sync,
) -> Vec<R> {
    if end < many { (0..end).map(work).collect() } else { (0..end).into_par_iter().map(work).collect() }
}

/// Writes the result of `work` for each entry of a list, in parallel if it is long.
pub(super) fn fill<T: Sync, R: Send>(
    list: &[T],
    out: &mut [R],
    long: usize,
    work: impl Fn(usize, &T) -> R + Send + Sync,
) {
    if list.len() < long {
        list.iter().zip(out).enumerate().for_each(|(i, (entry, out))| *out = work(i, entry));
    } else {
        list.par_iter().zip(out).enumerate().for_each(|(i, (entry, out))| *out = work(i, entry));
    }
}

/// Entries of a list that a thread takes at a time.
const PIECE: usize = 256;

/// Processes a list as a whole or, if it is long, piece by piece in parallel. `work` also gets the index of the
/// piece's first entry.
pub(super) fn in_pieces<T: Send, R: Send>(
    list: &mut [T],
    long: usize,
    work: impl Fn(usize, &mut [T]) -> R + Send + Sync,
) -> Vec<R> {
    if list.len() < long {
        return vec![work(0, list)];
    }
    let piece = |(number, piece): (usize, &mut [T])| work(number * PIECE, piece);
    list.par_chunks_mut(PIECE).enumerate().map(piece).collect()
}

/// Calls `work` for a short list of large entries, in parallel if it has several.
pub(super) fn for_each_parallel<T: Send>(list: Vec<T>, work: impl Fn(T) + Send + Sync) {
    if list.len() < 2 {
        list.into_iter().for_each(work);
    } else {
        list.into_par_iter().for_each(work);
    }
}

/// Splits the front of a list into pieces of these lengths.
pub(super) fn cut<T>(mut list: &mut [T], lengths: impl Iterator<Item = usize>) -> Vec<&mut [T]> {
    let cut_off = |length: usize| {
        let (piece, others) = std::mem::take(&mut list).split_at_mut(length);
        list = others;
        piece
    };
    lengths.map(cut_off).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_are_written_each_in_its_place() {
        let mut list = [0; 10];
        let found = cut(&mut list, [3, 0, 5].into_iter());
        assert_eq!(found.iter().map(|piece| piece.len()).collect::<Vec<_>>(), [3, 0, 5]);
        for_each_parallel(found.into_iter().zip(1..).collect(), |(piece, number)| piece.fill(number));
        assert_eq!(list, [1, 1, 1, 3, 3, 3, 3, 3, 0, 0]);
    }

    #[test]
    fn long_lists_come_out_as_short_ones_do() {
        let numbers: Vec<usize> = (0..2 * PIECE + 3).collect();
        for long in [1, numbers.len() + 1] {
            let mut list = vec![0; numbers.len()];
            let firsts = in_pieces(&mut list, long, |first, piece| {
                piece.iter_mut().zip(first..).for_each(|(entry, number)| *entry = number);
                first
            });
            assert_eq!(list, numbers);
            assert_eq!(firsts, if long == 1 { vec![0, PIECE, 2 * PIECE] } else { vec![0] });
            assert_eq!(map_numbers(numbers.len(), long, |number| number), numbers);
            fill(&numbers, &mut list, long, |number, entry| number + entry);
            assert_eq!(list, map(&numbers, long, |number| 2 * number));
        }
    }
}
