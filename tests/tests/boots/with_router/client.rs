//! A client and a real router, over a socket, in real time.

use std::net::{Ipv4Addr, UdpSocket};
use std::time::{Duration, Instant};

use harness::peer::Router;
use zenoh::{Declaration, Session, SessionOptions};

const TOKEN: &str = "@ros2_lv/0/c0ffee/0/0/NN/%/%/client";
const OPTIONS: SessionOptions = SessionOptions {
    // The first number of such a client is the last before numbers wrap.
    identity: 0xffff_fff0_0000_0000_0000_0000_00c0_ffee,
    lease_ms: 5000,
};

struct Client {
    session: Session,
    socket: UdpSocket,
    router: Router,
    started: Instant,
    /// Values heard here, and lines of the router's.
    heard: Vec<String>,
    said: Vec<String>,
}

impl Client {
    fn step(&mut self) {
        let now_ns = u64::try_from(self.started.elapsed().as_nanos()).expect("no such time");
        let declared = [Declaration::Subscriber("to/us"), Declaration::Token(TOKEN)];
        let mut room = [0; 2048];
        loop {
            let declaration = |place| declared.get(place).copied();
            let length = self.session.due(now_ns, declaration, &mut room);
            if length == 0 {
                break;
            }
            // A router may be away, and datagrams get lost.
            let _ = self.socket.send(&room[..length]);
        }
        if let Ok(length) = self.socket.recv(&mut room) {
            self.session.hear(now_ns, &room[..length], &mut |put| {
                let [key, payload] = [put.key, put.payload].map(String::from_utf8_lossy);
                let attachment = put.attachment.len();
                let is_stamped = put.stamp_ns.is_some();
                self.heard
                    .push(format!("{key} {attachment} {payload} {is_stamped}"));
            });
        }
        self.said.extend(self.router.said());
    }

    fn until(&mut self, what: &str, is_so: impl Fn(&Self) -> bool) {
        let begun = Instant::now();
        while !is_so(self) {
            let (said, heard, counts) = (&self.said, &self.heard, self.session.counts());
            let is_late = begun.elapsed() > Duration::from_secs(60);
            assert!(!is_late, "not {what}: {said:?} {heard:?} {counts:?}");
            self.step();
        }
    }

    /// Waits until the session is up for the n-th time, and the router has seen the token so often.
    fn until_up(&mut self, opened: u64) {
        let token = format!("token {TOKEN}");
        self.until("up", |it| {
            let tokens = it.said.iter().filter(|line| **line == token).count();
            it.session.counts().opened == opened
                && tokens >= 1
                && it.session.up_since_ns().is_some()
        });
        self.said.clear();
    }

    /// Puts a value each way.
    fn exchange(&mut self, payload: &str) {
        self.router
            .command(&format!("put to/us 010203 {}", hex(payload)));
        let heard = format!("to/us 3 {payload} true");
        self.until("heard", |it| it.heard.contains(&heard));
        let mut out = [0; 1400];
        let length = self
            .session
            .put("from/us", &[7; 33], payload.as_bytes(), &mut out);
        let sent = self.socket.send(&out[..length.expect("a session")]);
        sent.expect("a router");
        let said = format!("put from/us {} {}", "07".repeat(33), hex(payload));
        self.until("said", |it| it.said.contains(&said));
        // Once each, though the subscription has been declared again and again.
        let times = self.heard.iter().filter(|line| **line == heard).count();
        assert_eq!(times, 1, "{heard}");
    }
}

fn hex(payload: &str) -> String {
    payload.bytes().map(|byte| format!("{byte:02x}")).collect()
}

#[test]
fn a_real_router_takes_a_client_and_both_may_restart() {
    let router = Router::start(None);
    let port = router.port;
    let socket = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).expect("a port");
    socket.connect((Ipv4Addr::LOCALHOST, port)).expect("a way");
    let wait = socket.set_read_timeout(Some(Duration::from_millis(5)));
    wait.expect("a limit");
    let mut client = Client {
        session: Session::new(OPTIONS),
        socket,
        router,
        started: Instant::now(),
        heard: Vec::new(),
        said: Vec::new(),
    };
    client.until_up(1);
    client.exchange("first");
    // In fragments, and one at a time.
    let long = "long".repeat(1000);
    client
        .router
        .command(&format!("put to/us - {}", hex(&long)));
    let heard = format!("to/us 0 {long} true");
    client.until("heard", |it| it.heard.contains(&heard));
    // Leases pass by.
    let end = Instant::now() + 3 * Duration::from_millis(OPTIONS.lease_ms);
    client.until("older", |_| Instant::now() > end);
    client.exchange("later");
    assert!(!client.said.iter().any(|line| line.starts_with("gone")));
    let counts = client.session.counts();
    assert_eq!(
        [counts.opened, counts.lost, counts.malformed, counts.foreign],
        [1, 0, 0, 0]
    );
    // The router restarts.
    drop(client.router);
    client.router = Router::start(Some(port));
    client.until_up(2);
    client.exchange("of the second router");
    assert_eq!(client.session.counts().lost, 1);
    // The client restarts, within its lease, and closes its old session.
    client.session = Session::new(OPTIONS);
    client.until_up(1);
    client.exchange("of the second client");
    client.session.close();
    let gone = format!("gone {TOKEN}");
    client.until("gone", |it| it.said.contains(&gone));
}
