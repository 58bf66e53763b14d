//! The planner: requests to plans.
//!
//! Topics in: plan requests, `odometry` (the newest: where a plan starts). Topics out: `plan`, standing until the
//! next, and an answer to each request. A search takes as long as it takes: the process beats from another thread.

use core::time::Duration;

use kerbside_geometry::Pose;
use kerbside_messages::{
    EstimatorState, Header, Odometry, Plan, PlanAnswer, PlanRequest, PlanVerdict, TrajectoryPoint,
    seconds, text,
};
use kerbside_planning::{PlanFailure, plan};
use kerbside_runtime::{Asked, Newest, PlanPublisher, Server, Session, SessionError, now};

use crate::exit::{Exit, Failure};
use crate::life::{self, Service, Worker};
use crate::lockstep::words_of;

/// Longest wait for a request.
const WAIT: Duration = Duration::from_millis(100);

/// Runs the planner.
///
/// # Errors
/// [`Failure`] where the process cannot take part.
pub fn run(service: &Service) -> Result<Exit, Failure> {
    life::run_with_worker(service, Planner::open, |planner, worker| planner.serve(worker))
}

struct Planner {
    requests: Server<PlanRequest, PlanAnswer>,
    listener: kerbside_runtime::Listener,
    odometry: Newest<Odometry>,
    plans: PlanPublisher,
    service: Service,
}

impl Planner {
    fn open(session: &Session, service: &Service) -> Result<Self, SessionError> {
        Ok(Self {
            requests: session.server()?,
            listener: session.listener::<PlanRequest>()?,
            odometry: Newest::of(session.subscriber(None, 1)?),
            plans: session.plan_publisher()?,
            service: service.clone(),
        })
    }

    fn serve(&mut self, worker: &Worker) {
        self.listener.wait(WAIT);
        worker.progress();
        self.odometry.update();
        // A tracker that was restarted gets the standing plan only when this side connects to it.
        if let Err(error) = self.plans.refresh() {
            tracing::warn!(%error, "plan subscribers not connected");
        }
        while let Some(asked) = self.requests.receive() {
            self.odometry.update();
            self.answer(asked, worker);
        }
    }

    fn answer(&mut self, asked: Asked<PlanRequest, PlanAnswer>, worker: &Worker) {
        let request = *asked.request();
        tracing::info!(
            id = request.id,
            x = request.x,
            y = request.y,
            yaw = request.yaw,
            "planning"
        );
        let odometry = self.odometry.get();
        let mut answered =
            answer_request(&self.service, &request, odometry, &mut |_| worker.progress());
        if let Some((head, points)) = &answered.plan
            && let Err(error) = self.plans.send(head, points)
        {
            answered.answer.verdict = PlanVerdict::TooLong.code();
            answered.answer.text = text::from_str(&error.to_string());
        }
        let verdict = words_of(&answered.answer);
        tracing::info!(id = request.id, verdict, seconds = answered.search_seconds, "planned");
        if let Err(error) = asked.answer(answered.answer) {
            tracing::warn!(%error, "the client went away before its answer");
        }
        // A search needs as much as the scene is hard; what stays is not for the next one to be measured by.
        kerbside_runtime::release_memory();
    }
}

/// A request's answer, and the plan where one was found.
#[derive(Clone, Debug)]
pub struct Answered {
    /// The answer.
    pub answer: PlanAnswer,
    /// The plan.
    pub plan: Option<(Plan, Vec<TrajectoryPoint>)>,
    /// Wall time of the search \[s\]; in the answer too.
    pub search_seconds: f64,
}

/// Works on a request that starts at the newest estimate.
pub fn answer_request(
    service: &Service,
    request: &PlanRequest,
    odometry: Option<&Odometry>,
    progress: &mut dyn FnMut(u32),
) -> Answered {
    let begun = now();
    let outcome = start(odometry).and_then(|start| {
        plan(&service.vehicle, &service.stack.planner, start, request, progress)
            .map_err(|failure| refusal(&failure))
    });
    let search_seconds = seconds(now() - begun);
    let mut answer =
        PlanAnswer { id: request.id, search_time: search_seconds, ..PlanAnswer::default() };
    let plan = match outcome {
        Ok(planned) => {
            let origin = odometry.map_or_else(Default::default, |odometry| odometry.header);
            let head =
                Plan { header: Header::stamped(origin.stamp, origin.origin), ..planned.head };
            answer.verdict = PlanVerdict::Found.code();
            answer.length = head.length;
            answer.duration = head.duration;
            answer.clearance = head.clearance;
            answer.gear_changes = head.gear_changes;
            Some((head, planned.points))
        }
        Err((verdict, words)) => {
            answer.verdict = verdict.code();
            answer.text = text::from_str(&words);
            None
        }
    };
    Answered { answer, plan, search_seconds }
}

/// Where the plan starts: the newest estimate, of a vehicle that stands.
fn start(odometry: Option<&Odometry>) -> Result<Pose, (PlanVerdict, String)> {
    let none = || (PlanVerdict::NoPose, "no odometry has come yet".to_owned());
    let odometry = odometry.ok_or_else(none)?;
    if odometry.state != EstimatorState::Valid.code() {
        let state =
            EstimatorState::from_code(odometry.state).map_or("unknown", EstimatorState::name);
        return Err((PlanVerdict::NoPose, format!("the estimator says: {state}")));
    }
    if odometry.standstill == 0 {
        return Err((PlanVerdict::Moving, format!("speed is {:.3} m/s", odometry.speed)));
    }
    Ok(Pose::new(odometry.x, odometry.y, odometry.yaw))
}

fn refusal(failure: &PlanFailure) -> (PlanVerdict, String) {
    (failure.verdict(), failure.to_string())
}
