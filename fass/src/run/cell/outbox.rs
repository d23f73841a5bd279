//! The fourth cell: records on their way from the instances of one subtask to a reader.
//!
//! An instance *stages* a record, invisible to all others; its completion *publishes* the record.
//! If an instance is never complete, the next one overwrites its record. A record lies in one
//! piece: three words, and its bytes. Neither side waits for the other.
//!
//! > **Record invariant.** The words from `read` on up to `written`, round the end, are the
//! > reader's; all others belong to the holder of the *claim*. A claim is made by an `Acquire`
//! > exchange of `state` to `CLAIMED` from any other value, and given back by a `Release` store.
//! > Only the holder moves `written`, only the reader moves `read`, both by `Release` and on to
//! > words of their own; each loads the other's index by `Acquire`. There is one reader, whose
//! > methods take `&mut self`.

use alloc::boxed::Box;
use alloc::sync::Arc;
use alloc::vec::Vec;
use core::slice;
use core::sync::atomic::{AtomicU64, AtomicUsize, Ordering};

use recording::Full;

/// The words of a record before its bytes: the job, the time of its completion, the number of
/// bytes.
const HEAD: usize = 3;

/// Stands in the place of a record's job for "the next record is at the start". No run gets that
/// far.
const WRAP: u64 = u64::MAX;

/// Nothing is staged.
const FREE: usize = 0;

/// Somebody has the claim.
const CLAIMED: usize = 1;

/// A record had no room to be staged.
const LOST: usize = 2;

struct RecordRing {
    words: Box<[AtomicU64]>,
    /// `FREE`, `CLAIMED` or `LOST`, or else the end of the staged record, which lies after its
    /// head.
    state: AtomicUsize,
    /// The place of the next published record.
    written: AtomicUsize,
    /// The place of the reader's next record.
    read: AtomicUsize,
    /// The job whose value has no room.
    lost: AtomicU64,
}

/// The writing end.
pub(crate) struct Outbox(Arc<RecordRing>);

/// The reading end. There is only one, and no clone.
pub(crate) struct OutboxReader(Arc<RecordRing>);

/// A published record.
pub(crate) struct PublishedRecord<'b> {
    pub(crate) job: u64,
    pub(crate) at_ns: u64,
    pub(crate) bytes: &'b [u8],
}

/// Returns the number of words for a record.
pub(crate) const fn words_of(bytes: usize) -> usize {
    HEAD + bytes.div_ceil(8)
}

/// Makes an outbox of `count` words; `None`: there is no memory.
pub(crate) fn outbox(count: usize) -> Option<(Outbox, OutboxReader)> {
    let mut words = Vec::new();
    words.try_reserve_exact(count).ok()?;
    words.resize_with(count, || AtomicU64::new(0));
    let records = Arc::new(RecordRing {
        words: words.into(),
        state: AtomicUsize::new(FREE),
        written: AtomicUsize::new(0),
        read: AtomicUsize::new(0),
        lost: AtomicU64::new(0),
    });
    Some((Outbox(Arc::clone(&records)), OutboxReader(records)))
}

impl Outbox {
    /// Stages a record of at most `most` bytes. `write` puts the bytes into the place it gets, and
    /// returns their number. A record staged before and not published is given up.
    ///
    /// Each recorded value passes through here, and this crate is compiled for size: so the
    /// function is inlined into its callers.
    #[inline(always)]
    pub(crate) fn stage(
        &self,
        job: u64,
        most: usize,
        write: impl Fn(&mut [u8]) -> Result<usize, Full>,
    ) {
        let records = &*self.0;
        if !records.claim(FREE) && !records.claim_again() {
            return;
        }
        // At most two rounds: from the start of the words, `go_to_start` refuses to go there again.
        let state = loop {
            // Relaxed, as only the claim's holder moves `written`. Acquire for `read`: the reader
            // has read the words that it has given back.
            let place = records.written.load(Ordering::Relaxed);
            let read = records.read.load(Ordering::Acquire);
            let mut words = records.words.get(place..).unwrap_or_default();
            if place < read {
                // `place == read` would mean empty, so the words are never filled up to the reader.
                words = words.get(..read - 1 - place).unwrap_or_default();
            }
            let needed = match words {
                [of_job, _, length, rest @ ..] => {
                    let bytes = rest.as_ptr().cast_mut().cast::<u8>();
                    // SAFETY: by the record invariant these words belong to the claim's holder, and
                    // this call holds the claim. They are atomic, so they may be changed through a
                    // shared reference.
                    let bytes = unsafe { slice::from_raw_parts_mut(bytes, size_of_val(rest)) };
                    match write(bytes) {
                        Ok(count) if count <= most => {
                            // Relaxed: the reader sees these words only by the `Release` store of
                            // `written`.
                            of_job.store(job, Ordering::Relaxed);
                            length.store(count as u64, Ordering::Relaxed);
                            break place + words_of(count);
                        }
                        Ok(needed) | Err(Full { needed }) => needed,
                    }
                }
                // Not even the head fits. The bytes needed are unknown, and at least 0.
                _ => 0,
            };
            if needed > most || !records.go_to_start(place, read, needed) {
                records.lost.store(job, Ordering::Relaxed);
                break LOST;
            }
        };
        records.state.store(state, Ordering::Release);
    }

    /// Publishes the staged record, with the time of its completion; `false`: there is none, or it
    /// had no room.
    #[inline(always)]
    pub(crate) fn publish(&self, at_ns: u64) -> bool {
        let records = &*self.0;
        let state = records.state.load(Ordering::Relaxed);
        // Any larger state is the end of a staged record: its head alone has three words.
        if state <= LOST || !records.claim(state) {
            return false;
        }
        let place = records.written.load(Ordering::Relaxed);
        if let Some(at) = records.words.get(place + 1) {
            at.store(at_ns, Ordering::Relaxed);
        }
        // Before the claim is given back: the next holder loads the new `written`.
        records.written.store(state, Ordering::Release);
        records.state.store(FREE, Ordering::Release);
        true
    }

    /// Stages and publishes these bytes, with the time of their completion; `false`: they have no
    /// room.
    pub(crate) fn put(&self, job: u64, at_ns: u64, bytes: &[u8]) -> bool {
        let needed = bytes.len();
        self.stage(job, needed, |place| {
            let place = place.get_mut(..needed).ok_or(Full { needed })?;
            place.copy_from_slice(bytes);
            Ok(needed)
        });
        self.publish(at_ns)
    }

    /// Shows the staged record instead of publishing it: its job, and its bytes, if they had room.
    pub(crate) fn show(&self, look: impl FnOnce(u64, Option<&[u8]>)) {
        let records = &*self.0;
        let state = records.state.load(Ordering::Relaxed);
        if matches!(state, FREE | CLAIMED) || !records.claim(state) {
            return;
        }
        if state == LOST {
            look(records.lost.load(Ordering::Relaxed), None);
        } else if let Some(PublishedRecord { job, bytes, .. }) =
            records.record(records.written.load(Ordering::Relaxed))
        {
            look(job, Some(bytes));
        }
        records.state.store(FREE, Ordering::Release);
    }
}

impl RecordRing {
    /// Makes a claim if `from`, never `CLAIMED`, is the present state.
    #[inline(always)]
    fn claim(&self, from: usize) -> bool {
        let claim =
            (self.state).compare_exchange(from, CLAIMED, Ordering::Acquire, Ordering::Relaxed);
        claim.is_ok()
    }

    /// Makes a claim where a record is staged and not published, unless somebody else has a claim.
    #[cold]
    fn claim_again(&self) -> bool {
        let state = self.state.load(Ordering::Relaxed);
        state != CLAIMED && self.claim(state)
    }

    /// Makes the start the place of the next record, of `needed` bytes; `false`: there is no room.
    /// The caller has the claim.
    #[cold]
    fn go_to_start(&self, place: usize, read: usize, needed: usize) -> bool {
        // `place < read`: the writer has gone to the start already. An end at `read` would mean
        // empty.
        if place < read || words_of(needed) >= read {
            return false;
        }
        // The mark comes before the new `written`, by which the reader finds the mark. Behind the
        // last word no mark is needed.
        if let Some(word) = self.words.get(place) {
            word.store(WRAP, Ordering::Relaxed);
        }
        self.written.store(0, Ordering::Release);
        true
    }

    /// Returns the record at a place. The caller has the claim, or is the reader and has seen the
    /// record's publication.
    fn record(&self, place: usize) -> Option<PublishedRecord<'_>> {
        let [job, at, length, rest @ ..] = self.words.get(place..)? else {
            return None;
        };
        let length = usize::try_from(length.load(Ordering::Relaxed)).ok()?;
        let words = rest.get(..length.div_ceil(8))?;
        // SAFETY: by the record invariant nobody changes these words as long as the caller has
        // them, and both callers keep them for the time of the borrow.
        let bytes = unsafe { slice::from_raw_parts(words.as_ptr().cast::<u8>(), length) };
        Some(PublishedRecord {
            job: job.load(Ordering::Relaxed),
            at_ns: at.load(Ordering::Relaxed),
            bytes,
        })
    }
}

impl OutboxReader {
    /// Returns the next record, if one is published.
    pub(crate) fn next(&mut self) -> Option<PublishedRecord<'_>> {
        let records = &*self.0;
        let written = records.written.load(Ordering::Acquire);
        let mut place = records.read.load(Ordering::Relaxed);
        if place == written {
            return None;
        }
        let first = records.words.get(place);
        // At the end of the words, or at the writer's mark: the next record is at the start, where
        // perhaps nothing is published yet.
        if first.is_none_or(|job| job.load(Ordering::Relaxed) == WRAP) {
            place = 0;
            records.read.store(0, Ordering::Release);
            if written == 0 {
                return None;
            }
        }
        records.record(place)
    }

    /// Gives the record's words back.
    pub(crate) fn forget(&mut self) {
        if let Some(length) = self.next().map(|record| record.bytes.len()) {
            // Loaded after `next`, which may have moved the reader to the start.
            let place = self.0.read.load(Ordering::Relaxed);
            (self.0.read).store(place + words_of(length), Ordering::Release);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicBool;
    use std::thread;

    use super::*;

    /// Returns the record of a job: as many bytes as there are, from the job's on.
    fn bytes_of(job: u64) -> Vec<u8> {
        let [low, ..] = job.to_le_bytes();
        let all = (0..=u8::MAX).map(|number| low.wrapping_add(number));
        all.zip(0..job * 7 % 151).map(|(byte, _)| byte).collect()
    }

    fn stage(outbox: &Outbox, job: u64) {
        let content = bytes_of(job);
        outbox.stage(job, 150, |bytes| {
            let needed = content.len();
            let place = bytes.get_mut(..needed).ok_or(Full { needed })?;
            place.copy_from_slice(&content);
            Ok(needed)
        });
    }

    fn take(reader: &mut OutboxReader) -> Option<u64> {
        let PublishedRecord { job, at_ns, bytes } = reader.next()?;
        assert_eq!((at_ns, bytes), (job + 1, &*bytes_of(job)));
        reader.forget();
        Some(job)
    }

    #[test]
    fn only_what_is_published_is_read() {
        let (outbox, mut reader) = outbox(60).expect("there is memory");
        assert!(!outbox.publish(0), "nothing is staged");
        stage(&outbox, 1);
        assert_eq!(take(&mut reader), None);
        stage(&outbox, 2);
        assert!(outbox.publish(3));
        assert!(!outbox.publish(3), "once");
        assert_eq!((take(&mut reader), take(&mut reader)), (Some(2), None));
        stage(&outbox, 3);
        let mut shown = None;
        outbox.show(|job, bytes| shown = Some((job, bytes.map(<[u8]>::to_vec))));
        assert_eq!(shown, Some((3, Some(bytes_of(3)))));
        assert!(!outbox.publish(4));
        assert_eq!(take(&mut reader), None);
    }

    #[test]
    fn what_fits_comes_out_in_order_and_what_does_not_is_named() {
        let (outbox, mut reader) = outbox(83).expect("there is memory");
        let (mut read, mut lost) = (Vec::new(), Vec::new());
        let jobs = if cfg!(miri) { 200 } else { 2000 };
        for job in 0..jobs {
            stage(&outbox, job);
            if !outbox.publish(job + 1) {
                outbox.show(|job, bytes| {
                    assert_eq!(bytes, None);
                    lost.push(job);
                });
            }
            for _ in 0..job % 2 {
                read.extend(take(&mut reader));
            }
        }
        read.extend(core::iter::from_fn(|| take(&mut reader)));
        let most = if cfg!(miri) { (50, 5) } else { (500, 50) };
        assert!(read.is_sorted() && read.len() > most.0 && lost.len() > most.1);
        read.append(&mut lost);
        read.sort_unstable();
        assert!(read.into_iter().eq(0..jobs));
    }

    #[test]
    fn what_is_too_long_is_lost_although_there_is_room() {
        let (outbox, mut reader) = outbox(1000).expect("there is memory");
        outbox.stage(0, 8, |bytes| {
            bytes.fill(7);
            Ok(9)
        });
        assert!(!outbox.publish(1));
        assert!(reader.next().is_none());
    }

    #[test]
    fn threads_hand_records_over_whole() {
        let jobs = if cfg!(miri) { 40 } else { 200_000 };
        let (outbox, mut reader) = outbox(100).expect("there is memory");
        let is_over = AtomicBool::new(false);
        thread::scope(|scope| {
            scope.spawn(|| {
                for job in 0..jobs {
                    stage(&outbox, job);
                    outbox.publish(job + 1);
                }
                is_over.store(true, Ordering::Release);
            });
            let mut last = None;
            loop {
                let was_over = is_over.load(Ordering::Acquire);
                match take(&mut reader) {
                    Some(job) => assert!(last.replace(job) < Some(job)),
                    None if was_over => break,
                    None => thread::yield_now(),
                }
            }
        });
    }
}
