//! Case folders for tests.

use std::fs;
use std::path::{Path, PathBuf};

use tempfile::TempDir;

const VEHICLE: &str = r#"name = "by-tape"
wheelbase = 0.5
track_front = 0.31
track_rear = 0.31
radius = { fl = 0.0725, fr = 0.0725, rl = 0.0725, rr = 0.0725 }
drive = "rear"
[footprint]
length = 0.75
width = 0.37
rear_overhang = 0.13
[limits]
speed = 0.5
acceleration = 0.3
steering = 0.5236
steering_rate = 0.8
[encoders]
counts_per_revolution = { rl = 100, rr = 200 }
counter_bits = 8
rate = 50.0
[steering_sensor]
noise = 0.002
rate = 25.0
[reference]
noise = { position = 0.002, yaw = 0.002 }
rate = 25.0
"#;

/// What a car in good order may differ by.
const UNCERTAINTY: &str = "[uncertainty]\nwheelbase = 0.001\nradius = 0.0001\n\
                           [uncertainty.effect]\nspeed_gain.gain = 0.003\n";

/// A folder of cases.
pub(super) struct Cases(TempDir);

impl Cases {
    pub(super) fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    pub(super) fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// The case `name`, with a run.
    pub(super) fn add(&self, name: &str) -> PathBuf {
        let case = self.path(name);
        write(&case.join("vehicle.toml"), &format!("{VEHICLE}{UNCERTAINTY}"));
        let run = case.join("runs/straight-1");
        write(
            &run.join("run.toml"),
            "name = \"straight-1\"\nrepeat_of = \"straight-0\"\n[start]\nx = 1.0\ny = 2.0\nyaw = 0.5\n",
        );
        // The counters wrap, rr is read every other time, and fl is described by nobody.
        write(
            &run.join("encoders.csv"),
            "t,fl,rl,rr\n0.0,5,250,10\n0.1,6,5,\n0.2,7,105,250\n0.3,8,240,\n0.4,9,,200\n",
        );
        write(&run.join("commands.csv"), "t,speed,steering\n0.0,,0.1\n0.1,0.4,\n0.2,,0.2\n");
        write(&run.join("steering.csv"), "t,angle\n0.0,0.0\n0.1,\n0.2,0.1\n");
        write(&run.join("imu.csv"), "t,yaw_rate,ax\n0.0,0.0,1.0\n0.2,0.1,1.0\n");
        write(
            &run.join("reference.csv"),
            "t,x,y,yaw\n0.0,0.0,0.0,3.1\n0.1,0.1,,\n0.2,0.2,0.0,-3.1\n0.3,,,3.0\n0.4,0.4,0.1,\n",
        );
        case
    }

    /// The same vehicle that says nothing of itself.
    pub(super) fn forget_uncertainty(&self, name: &str) {
        write(&self.path(name).join("vehicle.toml"), VEHICLE);
    }
}

/// Writes a file, with the folders above it.
pub(super) fn write(path: &Path, content: &str) {
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    fs::write(path, content).unwrap();
}
