//! Live pictures in tev: never fatal when no viewer listens.

use std::net::{TcpStream, ToSocketAddrs};
use std::time::Duration;

use moonmilk_render::film::Developed;
use tev_client::{PacketCreateImage, PacketUpdateImage, TevClient};

const CHANNELS: [&str; 3] = ["R", "G", "B"];

/// A connection to tev, or nothing.
pub struct Display {
    client: Option<TevClient>,
    name: String,
    created: bool,
}

impl Display {
    /// Connects to HOST:PORT; warns and goes on if that fails.
    pub fn connect(address: Option<&str>, name: &str) -> Self {
        let client = address.and_then(|a| match open(a) {
            Ok(stream) => Some(TevClient::wrap(stream)),
            Err(e) => {
                tracing::warn!("no tev viewer at {a} ({e}); rendering goes on without");
                None
            }
        });
        Self { client, name: name.into(), created: false }
    }

    /// Returns whether somebody is looking.
    pub fn is_open(&self) -> bool {
        self.client.is_some()
    }

    /// Sends the picture.
    pub fn show(&mut self, picture: &Developed) {
        let Some(client) = &mut self.client else {
            return;
        };
        let send = |client: &mut TevClient, created: bool| -> std::io::Result<()> {
            if !created {
                client.send(PacketCreateImage {
                    image_name: &self.name,
                    grab_focus: true,
                    width: picture.width,
                    height: picture.height,
                    channel_names: &CHANNELS,
                })?;
            }
            client.send(PacketUpdateImage {
                image_name: &self.name,
                grab_focus: false,
                channel_names: &CHANNELS,
                channel_offsets: &[0, 1, 2],
                channel_strides: &[3, 3, 3],
                x: 0,
                y: 0,
                width: picture.width,
                height: picture.height,
                data: picture.rgb.as_flattened(),
            })
        };
        match send(client, self.created) {
            Ok(()) => self.created = true,
            Err(e) => {
                tracing::warn!("the tev viewer went away ({e}); rendering goes on");
                self.client = None;
            }
        }
    }
}

fn open(address: &str) -> std::io::Result<TcpStream> {
    let mut last = std::io::Error::new(std::io::ErrorKind::NotFound, "the address has no host");
    for a in address.to_socket_addrs()? {
        match TcpStream::connect_timeout(&a, Duration::from_secs(2)) {
            Ok(s) => {
                s.set_write_timeout(Some(Duration::from_secs(5)))?;
                return Ok(s);
            }
            Err(e) => last = e,
        }
    }
    Err(last)
}
