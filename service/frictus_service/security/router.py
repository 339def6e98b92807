"""The router of a site, and what each role may do there.

Denied unless allowed. Zenoh looks at each message twice: as it comes in from one member and as
it goes out to another, so each right stands here in both directions. Two of them are easily
missed: a declared publisher sends nothing until it has been told of a subscriber (egress
`declare_subscriber`), and what is cached for late joiners has keys of its own, below `@adv`.
"""

from collections.abc import Iterable, Sequence
from typing import Any, Final

import zenoh

from frictus.keys import CALLS, COMMAND, RECORDER_CALLS, ROOT, TOPICS, RigKeys, Topics
from frictus.session import open_router
from frictus_service.config import Config
from frictus_service.errors import ConfigurationError
from frictus_service.security.members import Member

_ANY: Final = RigKeys("any", "any")
_EVERYWHERE: Final = f"{ROOT}/*/*"
_CACHE: Final = "@adv/**"
"""Where Zenoh's advanced publishers answer for what they have cached."""
_COMMANDS: Final = tuple(topic for topic in TOPICS if topic.qos is COMMAND)
_PUBLISHED: Final = tuple(topic for topic in TOPICS if topic.qos is not COMMAND)
_GIVEN: Final = (Topics.GUIDANCE, Topics.MARKER)
"""What others publish: whoever calibrates on a rig, and bridges to other programs."""
_OWN: Final = tuple(topic for topic in _PUBLISHED if topic not in _GIVEN)
"""What a rig says."""
_FOR_ALL: Final = ("stop",)
"""A stop is never refused, whoever asks."""

Rule = dict[str, Any]
_SEND: Final = ("put", "delete")
_FOLLOW: Final = ("declare_liveliness_subscriber", "liveliness_query")


def access_control(members: Iterable[Member]) -> dict[str, Any]:
    """Return the section `access_control` of a Zenoh router's configuration.

    Parameters
    ----------
    members : iterable of Member
        Who may connect, each known by the common name of its certificate. Others that the
        authority signed may connect too, and neither say nor hear anything.
    """
    everybody = sorted(set(members), key=lambda member: member.common_name)
    subjects: list[dict[str, Any]] = []
    policies: list[dict[str, Any]] = []
    rules = {"observe": _observing(_EVERYWHERE), "control": _controlling()}
    shared = {
        "observer": ("observe",),
        "controller": ("observe", "control"),
    }
    for role, names in shared.items():
        bearers = [member.common_name for member in everybody if member.role == role]
        if bearers:
            subjects.append({"id": role, "cert_common_names": bearers})
            policies.append(_policy(role, [rule for name in names for rule in rules[name]]))
    for member in everybody:
        if member.role == "rig":
            own = _being(member.rig_keys)
            rules[member.common_name] = own
            subject = {"id": member.common_name, "cert_common_names": [member.common_name]}
            subjects.append(subject)
            policies.append(_policy(member.common_name, own))
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": [rule for group in rules.values() for rule in group],
        "subjects": subjects,
        "policies": policies,
    }


def _observing(base: str) -> list[Rule]:
    """Look on at the rigs below `base`, and stop them."""
    topics = _keys(base, [_ANY.of(topic) for topic in _PUBLISHED])
    cached = _cached(base)
    alive = _keys(_EVERYWHERE, [_ANY.alive])
    stop = _keys(base, [_ANY.call(name) for name in _FOR_ALL])
    return [
        _rule("observe", base, "ingress", ("declare_subscriber",), topics),
        # What a cache replies bears the key of what was cached.
        _rule("observe", base, "egress", (*_SEND, "reply"), topics),
        _rule("recall", base, "ingress", ("query", *_FOLLOW, "declare_subscriber"), cached),
        _rule("recall", base, "egress", ("reply", "liveliness_token", *_SEND), cached),
        _rule("presence", base, "ingress", _FOLLOW, alive),
        _rule("presence", base, "egress", ("liveliness_token",), alive),
        _rule("stop", base, "ingress", ("query",), stop),
        _rule("stop", base, "egress", ("reply", "declare_queryable"), stop),
    ]


def _controlling() -> list[Rule]:
    """Command every rig, hold leases, and guide a participant."""
    base = _EVERYWHERE
    sent = _keys(base, [_ANY.of(topic) for topic in (*_COMMANDS, *_GIVEN)])
    calls = _keys(base, _calls(_ANY))
    token = _keys(base, [_ANY.any_client_alive])
    return [
        _rule("command", base, "ingress", _SEND, sent),
        _rule("command", base, "egress", ("declare_subscriber",), sent),
        _rule("call", base, "ingress", ("query",), calls),
        _rule("call", base, "egress", ("reply", "declare_queryable"), calls),
        _rule("lease", base, "ingress", ("liveliness_token",), token),
    ]


def _being(keys: RigKeys) -> list[Rule]:
    """Be one rig, its recorder and its tracker."""
    base = keys.base
    said = [keys.of(topic) for topic in _OWN]
    heard = [keys.of(topic) for topic in (*_COMMANDS, *_GIVEN)]
    cached = _cached(base)
    # Whoever follows every rig at once subscribes to, and asks for, more than this rig says.
    followed = _keys(_EVERYWHERE, [_ANY.of(topic) for topic in _OWN])
    recalled = _cached(_EVERYWHERE)
    calls = _calls(keys)
    adapt = [keys.call("adapt")]
    return [
        *_observing(base),  # its recorder listens to it
        _rule("say", base, "ingress", (*_SEND, "reply"), said),
        _rule("say", base, "egress", ("declare_subscriber",), followed),
        _rule("remember", base, "ingress", ("declare_queryable", "liveliness_token"), cached),
        _rule("remember", base, "egress", ("query", "declare_subscriber", *_FOLLOW), recalled),
        _rule("hear", base, "ingress", ("declare_subscriber",), heard),
        _rule("hear", base, "egress", _SEND, heard),
        _rule("answer", base, "ingress", ("declare_queryable", "reply"), calls),
        _rule("answer", base, "egress", ("query",), calls),
        _rule("adapt", base, "ingress", ("query",), adapt),  # its tracker asks
        _rule("adapt", base, "egress", ("reply", "declare_queryable"), adapt),
        _rule("alive", base, "ingress", ("liveliness_token",), [keys.alive]),
        _rule("owner", base, "ingress", _FOLLOW, [keys.any_client_alive]),
        _rule("owner", base, "egress", ("liveliness_token",), [keys.any_client_alive]),
    ]


def _keys(base: str, keys: Iterable[str]) -> list[str]:
    """Return keys of `_ANY` as those below `base`."""
    return [base + key.removeprefix(_ANY.base) for key in keys]


def _cached(base: str) -> list[str]:
    latest = [_ANY.of(topic) for topic in _PUBLISHED if topic.latest]
    return [f"{key}/{_CACHE}" for key in _keys(base, latest)]


def _calls(keys: RigKeys) -> list[str]:
    return [keys.call(name) for name in (*CALLS, *RECORDER_CALLS)]


def _rule(what: str, base: str, flow: str, messages: Sequence[str], keys: list[str]) -> Rule:
    return {
        "id": f"{what} {flow} {'+'.join(messages)} {base}",
        "permission": "allow",
        "flows": [flow],
        "messages": list(messages),
        "key_exprs": keys,
    }


def _policy(subject: str, rules: list[Rule]) -> dict[str, Any]:
    return {"subjects": [subject], "rules": [rule["id"] for rule in rules]}


def open_secured_router(config: Config) -> zenoh.Session:
    """Host the configured router in this process.

    Parameters
    ----------
    config : Config
        Its router and security sections are used; without the latter, whoever reaches the
        router may do everything.

    Raises
    ------
    ConfigurationError
        If certificates are used and the router has none, or no folder of members.
    CertificateError, CertificateFileError
        If a certificate cannot be used.
    LinkError
        If nothing can listen there.
    """
    endpoint, security = config.router.endpoint, config.security
    if security is None:
        return open_router(endpoint, links=config.router.links)
    if security.members is None:
        raise ConfigurationError(
            "security.members: this key is required where the router runs: the folder with "
            "the certificates of all who may use it"
        )
    from frictus_service.security.files import members_in  # only with certificates

    access = access_control(members_in(security.members))
    return open_router(endpoint, security.of("router"), access)
