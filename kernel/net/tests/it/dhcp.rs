//! A client of DHCP and a server of a few lines.

use core::net::Ipv4Addr;

use net::{Client, Lease};

use crate::frames::{IP, MAC};

const SERVER: [u8; 4] = [10, 0, 2, 2];
const S: u64 = 1_000_000_000;

/// Sends what is due, and returns the kind of the message and what it asks for.
fn sent(client: &mut Client, now_ns: u64) -> Option<(u8, Vec<u8>)> {
    let mut message = vec![0xee; 400];
    let length = client.send(now_ns, &mut message)?;
    message.truncate(length);
    Some((message[242], message))
}

/// Sends the next message at its time, and returns its kind.
fn next(client: &mut Client) -> u8 {
    let now_ns = client.due_ns();
    sent(client, now_ns).unwrap().0
}

/// Returns the answer of a server to a message.
pub(super) fn answer(to: &[u8], kind: u8, seconds: u32) -> Vec<u8> {
    let mut answer = to.to_vec();
    answer[0] = 2;
    answer[16..20].copy_from_slice(&IP.octets());
    answer.truncate(240);
    answer.extend([53, 1, kind, 0, 12, 2, b'a', b'b', 54, 4]);
    answer.extend(SERVER);
    answer.extend([1, 4, 255, 255, 255, 0, 3, 4, 10, 0, 2, 2, 51, 4]);
    answer.extend(seconds.to_be_bytes());
    answer.push(255);
    answer
}

fn bound(seconds: u32) -> Client {
    let mut client = Client::new(MAC, 7);
    let (kind, discover) = sent(&mut client, 0).unwrap();
    assert_eq!(kind, 1);
    assert!(!client.take(&answer(&discover, 2, seconds), 1));
    let (kind, request) = sent(&mut client, 1).unwrap();
    assert_eq!(
        (kind, &request[249..263]),
        (3, &[50, 4, 10, 0, 2, 15, 54, 4, 10, 0, 2, 2, 255, 0][..])
    );
    assert!(client.take(&answer(&request, 5, seconds), 2));
    client
}

#[test]
fn an_address_is_offered_asked_for_and_given() {
    let Some(Lease {
        address,
        server,
        seconds,
    }) = bound(100).lease()
    else {
        panic!("no lease");
    };
    assert_eq!((address.ip, address.prefix), (IP, 24));
    assert_eq!(
        (address.gateway, server),
        (Some(SERVER.into()), Ipv4Addr::from(SERVER))
    );
    assert_eq!(seconds, 100);
    assert_eq!(bound(u32::MAX).due_ns(), u64::MAX / 2 + 2);
}

#[test]
fn a_lease_is_renewed_at_its_half_and_lost_at_its_end() {
    let mut client = bound(100);
    assert_eq!(sent(&mut client, 49 * S), None);
    let (kind, request) = sent(&mut client, 51 * S).unwrap();
    assert_eq!((kind, &request[12..16]), (3, &IP.octets()[..]));
    assert!(
        !client.take(&answer(&request, 5, 100), 52 * S),
        "the same one"
    );
    let mut now_ns = 101 * S;
    while client.lease().is_some() {
        assert!(now_ns <= 152 * S, "given until 152 s");
        now_ns = client.due_ns().max(now_ns);
        sent(&mut client, now_ns).unwrap();
    }
    assert_eq!(now_ns, 152 * S);
    let later = client.due_ns();
    assert_eq!(
        sent(&mut client, later).unwrap().0,
        1,
        "looks for a server anew"
    );
}

#[test]
fn a_silent_server_is_asked_ever_more_seldom() {
    let mut client = Client::new(MAC, 7);
    let mut times = Vec::new();
    for _ in 0..9 {
        times.push(client.due_ns() / S);
        next(&mut client);
    }
    assert_eq!(times, [0, 1, 3, 7, 15, 31, 63, 127, 191]);
}

#[test]
fn an_offer_that_is_taken_back_is_given_up() {
    let mut client = bound(100);
    let (_, request) = sent(&mut client, 51 * S).unwrap();
    let mut of_another = answer(&request, 6, 100);
    of_another[250] ^= 1;
    assert!(!client.take(&of_another, 51 * S), "it is another's word");
    assert!(
        client.take(&answer(&request, 6, 100), 51 * S),
        "the address is lost"
    );
    let (kind, discover) = sent(&mut client, 51 * S).unwrap();
    assert_eq!(kind, 1);
    assert_ne!(
        discover[4..8],
        request[4..8],
        "answers to what was before are not taken"
    );
    // A server that offers and then is silent is left after some requests.
    client.take(&answer(&discover, 2, 100), 51 * S);
    let kinds = (0..6).map(|_| next(&mut client));
    assert_eq!(kinds.collect::<Vec<_>>(), [3, 3, 3, 3, 1, 1]);
}

#[test]
fn an_answer_that_is_not_whole_or_not_ours_gives_no_address() {
    let edits: [(usize, u8); 8] = [
        (0, 1),    // a question
        (5, 9),    // another transaction
        (33, 9),   // another card
        (236, 0),  // no cookie
        (16, 224), // the address of a group
        (19, 255), // the address of all
        (259, 1),  // a mask with a hole
        (241, 99), // an option longer than the message
    ];
    let mut client = Client::new(MAC, 7);
    let (_, discover) = sent(&mut client, 0).unwrap();
    let right = answer(&discover, 2, 100);
    let wrong = edits.map(|(at, byte)| {
        let mut wrong = right.clone();
        wrong[at] = byte;
        wrong
    });
    let short = (0..right.len() - 1).map(|length| right[..length].to_vec());
    for wrong in wrong
        .into_iter()
        .chain(short)
        .chain([answer(&discover, 2, 0)])
    {
        client.take(&wrong, 0);
        assert_eq!(
            next(&mut client),
            1,
            "{:02x?}",
            &wrong[wrong.len().min(236)..]
        );
    }
}
