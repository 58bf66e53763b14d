"""Drives the simulated vehicle while a noisy sensor of absolute poses corrects the estimate.

It tells the estimator where the vehicle stands, but wrongly; arms; requests a plan; and while the vehicle drives it
publishes what a camera beside the lot might see: the true pose with noise, as `fix`. At the end it says how far the
estimate is off the truth. With --no-fixes the error of the first fix stays.

    kerbside up --simulate --start=-1.0,0.65,0
    python3 closing_the_loop.py
"""

import argparse
import json
import math
import random
import sys
import time

import kerbside_messages as messages
from kerbside_instance import Instance

PATIENCE = 30.0


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--instance", default="kerbside", help="name of the instance")
    parser.add_argument("--ahead", type=float, default=1.0, help="how far to drive straight on [m]")
    parser.add_argument("--rate", type=float, default=10.0, help="fixes per second while the vehicle drives [Hz]")
    parser.add_argument("--noise", type=float, default=0.01, help="standard deviation of a fix in x and y [m]")
    parser.add_argument("--yaw-noise", type=float, default=0.5, help="standard deviation of its heading [degrees]")
    parser.add_argument("--wrong", type=float, default=0.03, help="how far the first fix is off in x and y [m]")
    parser.add_argument("--no-fixes", action="store_true", help="publish the first fix alone")
    parser.add_argument("--seed", type=int, default=1, help="of the noise")
    return parser.parse_args()


def wait_for(what, look):
    """Looks again and again until there is something; ends the program where it does not come."""
    deadline = time.monotonic() + PATIENCE
    while time.monotonic() < deadline:
        found = look()
        if found is not None:
            return found
        time.sleep(0.005)  # The rate at which it looks: as often as the vehicle is read.
    sys.exit(f"{what} does not come")


def fix(pose, deviation, yaw_deviation, stamp):
    """A fix of the rear axle's centre at `pose` (x, y, yaw), true at `stamp`."""
    message = messages.Fix()
    message.header.stamp = stamp
    message.x, message.y, message.yaw = pose
    message.covariance[0] = message.covariance[4] = deviation**2
    message.covariance[8] = yaw_deviation**2
    messages.set_text(message.source, "closing_the_loop.py")
    return message


def plan_request(arm, start, ahead):
    """A way straight on through free space."""
    request = messages.PlanRequest()
    request.id = time.monotonic_ns()
    request.arm = arm
    request.x = start.x + ahead * math.cos(start.yaw)
    request.y = start.y + ahead * math.sin(start.yaw)
    request.yaw = start.yaw
    request.steering, request.speed = math.radians(28), 0.2
    room = 3.0 + ahead
    request.bounds[:] = [start.x - room, start.y - room, start.x + room, start.y + room]
    request.gear_changes = 2
    return request


class Drive:
    """The vehicle, as this process knows it."""

    def __init__(self, instance, options):
        self.options = options
        self.random = random.Random(options.seed)
        self.topics = {name: instance.subscriber(name) for name in ("odometry", "truth", "state")}
        self.newest = dict.fromkeys(self.topics)
        self.fixes = instance.publisher("fix")
        self.operator = instance.client("operator", "operator_answer")
        self.planner = instance.client("plan_request", "plan_answer")

    def look(self):
        """Takes in what came; whether all topics have come."""
        for name, subscriber in self.topics.items():
            self.newest[name] = subscriber.newest() or self.newest[name]
        return all(message is not None for message in self.newest.values())

    def ready(self):
        """The odometry of a stack that may be told where its vehicle stands."""
        if not self.look() or self.newest["state"].mode != messages.Mode.READY:
            return None
        return self.newest["odometry"] if self.newest["odometry"].standstill else None

    def error(self):
        """How far the estimate is off the truth: distance [m], heading [degrees]."""
        is_, true = self.newest["odometry"], self.newest["truth"]
        turn = math.remainder(is_.yaw - true.yaw, math.tau)
        return math.hypot(is_.x - true.x, is_.y - true.y), abs(math.degrees(turn))

    def tell_wrong_start(self):
        """The first fix: off by what it says it may be off by."""
        before, true, wrong = self.newest["odometry"], self.newest["truth"], self.options.wrong
        pose = (true.x + wrong, true.y - wrong, true.yaw + math.radians(1))
        self.fixes.send(fix(pose, wrong, math.radians(1), time.monotonic_ns()))

        def judged():
            self.look()
            now = self.newest["odometry"]
            return now if now.fix_sequence != before.fix_sequence or now.resets != before.resets else None

        after = wait_for("a judgement of the first fix", judged)
        if after.fix_verdict != messages.FixVerdict.ACCEPTED:
            sys.exit(f"the first fix: {messages.FixVerdict(after.fix_verdict).name}")

    def arm(self):
        """Permits motion; the count of arms."""
        request = messages.OperatorRequest()
        request.id, request.verb = time.monotonic_ns(), messages.Verb.ARM
        answer = self.operator.ask(request, 1.0)
        if answer is None or not answer.accepted:
            sys.exit("not armed: " + (messages.text(answer.text) if answer else "no answer"))
        return answer.arms

    def plan(self, arm):
        """Has a plan made; the vehicle drives it at once."""
        answer = self.planner.ask(plan_request(arm, self.newest["odometry"], self.options.ahead), PATIENCE)
        if answer is None or answer.verdict != messages.PlanVerdict.FOUND:
            sys.exit("no plan: " + (messages.text(answer.text) if answer else "no answer"))

    def see(self):
        """What a camera beside the lot sees."""
        true, options = self.newest["truth"], self.options
        yaw_noise = math.radians(options.yaw_noise)
        pose = (
            self.random.gauss(true.x, options.noise),
            self.random.gauss(true.y, options.noise),
            self.random.gauss(true.yaw, yaw_noise),
        )
        return fix(pose, options.noise, yaw_noise, true.header.stamp)

    def follow(self, arm):
        """Publishes fixes while the vehicle drives, until it is over; how many."""
        sent, due, moved = 0, time.monotonic(), False

        def over():
            nonlocal sent, due, moved
            self.look()
            state, moves = self.newest["state"], abs(self.newest["truth"].speed) > 0.02
            moved = moved or moves
            if moves and not self.options.no_fixes and time.monotonic() >= due:
                due = time.monotonic() + 1 / self.options.rate
                self.fixes.send(self.see())
                sent += 1
            halted = state.mode in (messages.Mode.READY, messages.Mode.FAULTED) and state.arms >= arm
            return state if halted and not moves else None

        state = wait_for("the end of the drive", over)
        if state.cause != messages.Cause.COMPLETED or not moved:
            sys.exit(f"stopped: {messages.Cause(state.cause).name} {messages.text(state.text)}")
        return sent


def main():
    options = arguments()
    with Instance(options.instance) as instance:
        drive = Drive(instance, options)
        wait_for("a stack that is ready", drive.ready)
        drive.tell_wrong_start()
        first = drive.error()
        arm = drive.arm()
        drive.plan(arm)
        sent = drive.follow(arm)
        last = drive.error()
        corrections = drive.newest["odometry"].corrections
        refused = sum(subscriber.refused for subscriber in drive.topics.values())
        del drive
    result = {
        "fixes": sent,
        "corrections": corrections,
        "refused": refused,
        "first_error": {"position_m": first[0], "yaw_degrees": first[1]},
        "last_error": {"position_m": last[0], "yaw_degrees": last[1]},
    }
    print(json.dumps(result))


if __name__ == "__main__":
    main()
