"""A Python process's part in an instance of kerbside: it opens what the supervisor created.

Needs `kerbside_messages.py` beside it or in PYTHONPATH (`kerbside bindings python --out kerbside_messages.py`) and the
PyPI package iceoryx2 in the version of the stack's own, 0.10.0.
"""

import os
import pathlib
import re
import time

import iceoryx2 as iox2
import kerbside_messages as messages


def run_time_folder():
    """Where instances live: the user's run-time folder."""
    folder = os.environ.get("XDG_RUNTIME_DIR")
    return pathlib.Path(folder) / "kerbside" if folder else pathlib.Path(f"/tmp/kerbside-{os.geteuid()}")


class Instance:
    """A running instance. Use it in a `with` block: what was opened is given back at the end."""

    def __init__(self, name="kerbside"):
        configuration = run_time_folder() / name / "iox.toml"
        try:
            text = configuration.read_text()
        except FileNotFoundError:
            raise SystemExit(f"instance {name} is not running: there is no {configuration}") from None
        value = {key: re.search(rf'^{key} = "(.*)"$', text, re.M).group(1) for key in ("root-path", "prefix")}
        theirs, ours = re.search(r"^# layout version (\d+)$", text, re.M), messages.LAYOUT_VERSION
        if theirs and int(theirs.group(1)) != ours:
            raise SystemExit(f"instance {name} has layout version {theirs.group(1)}, kerbside_messages.py has {ours}")
        iox2.set_log_level(iox2.LogLevel.Error)
        # The clean-up of half-created nodes looks at the configuration of the process, not of the node.
        iox2.config.setup_global_config_from_file(iox2.FilePath.new(str(configuration)))
        config = iox2.config.default()
        config.global_cfg.root_path = iox2.Path.new(value["root-path"])
        config.global_cfg.prefix = iox2.FileName.new(value["prefix"])
        # The supervisor alone sweeps what dead processes left.
        config.global_cfg.node.cleanup_dead_nodes_on_creation = False
        config.global_cfg.node.cleanup_dead_nodes_on_destruction = False
        config.global_cfg.service.cleanup_dead_nodes_on_open = False
        self.node = (
            iox2.NodeBuilder.new()
            .name(iox2.NodeName.new("python"))
            .config(config)
            .signal_handling_mode(iox2.SignalHandlingMode.Disabled)
            .create(iox2.ServiceType.Ipc)
        )

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.node = None

    def subscriber(self, topic, buffer=64):
        """Receives samples of a topic, by its name in the table."""
        return Subscriber(self.node, messages.TOPICS[topic], buffer)

    def publisher(self, topic):
        """Publishes samples of a topic that anyone may publish: fix, inhibit."""
        return Publisher(self.node, messages.TOPICS[topic])

    def client(self, question, answer):
        """Asks `question` and is given `answer`, both by their names in the table."""
        return Client(self.node, messages.TOPICS[question], messages.TOPICS[answer])


class Subscriber:
    """Receives samples of a topic; each is a copy that passed its checks."""

    def __init__(self, node, topic, buffer):
        self.topic = topic
        service = node.service_builder(iox2.ServiceName.new(topic.name)).publish_subscribe(topic.payload).open()
        self.port = service.subscriber_builder().buffer_size(buffer).create()
        self.refused = 0

    def receive(self):
        """The next sample, or None."""
        while (sample := self.port.receive()) is not None:
            message = self.topic.payload.from_buffer_copy(sample.payload().contents)
            try:
                messages.verify(self.topic, message)
            except ValueError:
                self.refused += 1
                continue
            return message
        return None

    def newest(self):
        """The newest of what came since the last look, or None."""
        newest = None
        while (message := self.receive()) is not None:
            newest = message
        return newest


class Publisher:
    """Publishes samples of a topic."""

    def __init__(self, node, topic):
        self.topic = topic
        service = node.service_builder(iox2.ServiceName.new(topic.name)).publish_subscribe(topic.payload).open()
        self.port = service.publisher_builder().create()
        # One number per life of the publisher, greater than that of any earlier life.
        self.epoch = time.monotonic_ns()
        self.sequence = 0

    def send(self, message):
        """Seals a message and sends it; `message.header.stamp` says when its content was true."""
        self.sequence += 1
        messages.seal(self.topic, message, self.epoch, self.sequence)
        self.port.send_copy(message)


class Client:
    """Asks and waits for the answer."""

    def __init__(self, node, question, answer):
        self.question, self.answer = question, answer
        name = iox2.ServiceName.new(question.name)
        service = node.service_builder(name).request_response(question.payload, answer.payload).open()
        self.port = service.client_builder().create()
        # Who answers sleeps until it is woken.
        self.notifier = node.service_builder(name).event().open().notifier_builder().create()

    def ask(self, message, patience):
        """The answer; None where none came within `patience` seconds."""
        messages.seal(self.question, message, time.monotonic_ns(), 1)
        pending = self.port.send_copy(message)
        self.notifier.notify()
        deadline = time.monotonic() + patience
        while time.monotonic() < deadline:
            response = pending.receive()
            if response is not None:
                answer = self.answer.payload.from_buffer_copy(response.payload().contents)
                messages.verify(self.answer, answer)
                return answer
            time.sleep(0.001)  # The rate at which it looks, until `patience` is over.
        return None
