//! Keys of the gateway.

use super::StackDraft;
use crate::declare::{Kind, Range, Schema};
use crate::stack::Right;

const HOLDER: Kind = Kind::Text;

/// `[gateway]` and `[gateway.rights]`.
pub(super) fn declare(schema: Schema<StackDraft>) -> Schema<StackDraft> {
    declare_rights(declare_limits(declare_place(schema)))
}

fn declare_place(schema: Schema<StackDraft>) -> Schema<StackDraft> {
    schema
        .section(
            "gateway",
            "The door for processes of other users: a Unix-domain socket. Shared memory is for the \
             instance's own user alone.",
        )
        .key("gateway.enabled", Kind::Flag, "Whether the instance has a gateway.", |s| {
            &mut s.gateway.enabled
        })
        .optional(
            "gateway.socket",
            Kind::Text,
            "NAME.gateway in /run/kerbside where that folder is the instance's user's, else in \
             /tmp/kerbside-gateway-UID",
            "The socket, relative to this file unless it begins with a slash. Its folder must be \
             one that other users reach and cannot write to.",
            |s| &mut s.gateway_socket,
        )
}

fn declare_limits(schema: Schema<StackDraft>) -> Schema<StackDraft> {
    schema
        .key(
            "gateway.clients",
            Kind::Integer { unit: "", low: 1, high: 256 },
            "Most clients at once; one more is refused.",
            |s| &mut s.gateway.clients,
        )
        .key(
            "gateway.clients_per_user",
            Kind::Integer { unit: "", low: 1, high: 256 },
            "Most clients of one user at once.",
            |s| &mut s.gateway.clients_per_user,
        )
        .key(
            "gateway.line_length",
            Kind::Integer { unit: "byte", low: 1024, high: 1_048_576 },
            "Longest line a client may send; who sends a longer one is disconnected.",
            |s| &mut s.gateway.line_length,
        )
        .key(
            "gateway.request_rate",
            Kind::unit("Hz", Range::from(0.1).to(1000.0)),
            "Most requests of one user a second, all of its clients together; what comes faster \
             waits in the client's own buffer.",
            |s| &mut s.gateway.request_rate,
        )
        .key(
            "gateway.sample_rate",
            Kind::unit("Hz", Range::from(0.1).to(100.0)),
            "Most samples of a topic that a client may ask for a second.",
            |s| &mut s.gateway.sample_rate,
        )
        .key(
            "gateway.patience",
            Kind::seconds(Range::from(0.1).to(60.0)),
            "Longest time a client may take for a line that it is sent; then it is disconnected.",
            |s| &mut s.gateway.patience,
        )
        .key(
            "gateway.inhibit",
            Kind::seconds(Range::from(0.1).to(3600.0)),
            "Longest inhibit of one request; who wants a longer one asks again in time.",
            |s| &mut s.gateway.inhibit,
        )
}

/// A right is a line of an enum; its key here follows.
fn declare_rights(schema: Schema<StackDraft>) -> Schema<StackDraft> {
    let mut schema = schema.section(
        "gateway.rights",
        "Who may do what through the gateway: users by name or number, groups as \"@name\" \
         or \"@number\", \"*\" for everybody. The instance's own user and root may do everything.",
    );
    for right in Right::ALL {
        let what = match right {
            Right::Watch => "Who may ask for the status and subscribe to topics.",
            Right::Fix => "Who may tell the estimator where the vehicle is.",
            Right::Inhibit => "Who may inhibit motion for a time.",
            Right::Plan => "Who may ask the planner for a plan.",
            Right::Arm => "Who may permit motion for the next plan.",
            Right::Stop => "Who may stop the vehicle.",
        };
        schema = schema.optional(
            format!("gateway.rights.{}", right.name()),
            Kind::List { of: &HOLDER, least: 1, most: 64 },
            "nobody else",
            what,
            move |s: &mut StackDraft| &mut s.gateway.holders[right as usize],
        );
    }
    schema
}
