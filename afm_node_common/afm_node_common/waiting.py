"""Telling cheaply whether an executor would find anything to do.

An executor builds a wait set over every entity of its nodes each time it is asked, in Python. For the simulator this
takes 240 us. The wait sets here are built once, and again only when entities come or go. There are two: 24 of the
simulator's 35 entities are events of the middleware (a warning of another QoS, say), which can wait. Wait sets are no
documented surface of rclpy; where they are not there, the executor is asked.

With nothing ready and a timeout of zero the middleware still sleeps, for the kernel's timer slack and the way back: a
look took 80 us. So a guard condition that is always triggered is waited for as well: 8 us.
"""

import inspect
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

from rclpy.event_handler import EventHandler
from rclpy.node import Node

from .direct import Unscheduled

_KINDS = ("subscription", "guard_condition", "timer", "client", "service")
"""What a wait set can list as ready, in the order of its constructor; events are the sixth and are asked one by one."""


class _Look:
    """One wait set, kept.

    Parameters
    ----------
    context : Context of the nodes.
    handles : mapping of str to list
        Entities with a handle, by kind.
    waitables : list
        Entities that consist of others.

    Raises
    ------
    ImportError, AttributeError, TypeError
        Where this rclpy has no such wait set.
    """

    def __init__(self, context: Any, handles: Mapping[str, list[Any]], waitables: list[Any]) -> None:
        from rclpy.impl.implementation_singleton import rclpy_implementation

        needed = [entity.get_num_entities() for entity in waitables]
        sizes = {kind: len(handles.get(kind, ())) + sum(getattr(n, f"num_{kind}s") for n in needed) for kind in _KINDS}
        self._events = sum(n.num_events for n in needed)
        self._guards = handles.get("guard_condition", [])
        # A look takes the trigger of a guard condition away. One of ours is triggered again; one that is hidden in a
        # waitable cannot be.
        self.sure = sizes["guard_condition"] == len(self._guards)
        """Whether nothing gets lost by looking."""
        self._empty = not any(sizes.values()) and not self._events
        self._kinds = [kind for kind, size in sizes.items() if size and kind != "guard_condition"]
        sizes["guard_condition"] += 1
        self._set: Any = rclpy_implementation.WaitSet(*sizes.values(), self._events, context.handle)
        awake: Any = rclpy_implementation.GuardCondition(context.handle)
        self._add: list[Callable[[], object]] = [
            awake.trigger_guard_condition,
            partial(self._set.add_guard_condition, awake),
        ]
        self._add += [
            partial(getattr(self._set, f"add_{kind}"), entity.handle)
            for kind, entities in handles.items()
            for entity in entities
        ]
        self._add += [partial(entity.add_to_wait_set, self._set) for entity in waitables]

    def __call__(self) -> bool:
        """Whether anything is ready."""
        if self._empty:
            return False
        self._set.clear_entities()
        for add in self._add:
            add()
        self._set.wait(0)
        for guard in self._guards:
            if guard.handle.pointer in self._set.get_ready_entities("guard_condition"):
                guard.trigger()
                return True
        return any(self._set.get_ready_entities(kind) for kind in self._kinds) or any(
            self._set.is_ready("event", index) for index in range(self._events)
        )


class Waiting:
    """Checks whether an executor would find anything to do, at a fraction of the price of asking it.

    Parameters
    ----------
    nodes : sequence of Node
        All that they have counts, inboxes left out: subscriptions, timers, clients, services, guard conditions, and
        waitables, which are action servers, action clients and events. What is created or destroyed later counts from
        then on.
    events_every : int
        Events of the middleware are looked at in one of so many looks.
    """

    def __init__(self, nodes: Sequence[Node], events_every: int = 1) -> None:
        self._nodes = nodes
        self._events_every = events_every
        self._looks = 0
        self._executor: Any = nodes[0].executor
        self._entities: list[Any] = []
        self._prompt: _Look | None = None  # None: only the executor can tell
        self._events: _Look | None = None
        self.unfinished = False
        """Whether tasks have begun and not ended: coroutines that the executor has to resume now and then."""
        self()

    def __call__(self) -> bool:
        """Return whether anything is ready, or a task has not begun; always true if this cannot be found cheaply."""
        tasks = [task for task, *_ in getattr(self._executor, "_tasks", ()) if not task.done()]
        self.unfinished = any(map(_begun, tasks))
        entities: list[Any] = []
        for node in self._nodes:
            for some in (node.subscriptions, node.guards, node.timers, node.clients, node.services, node.waitables):
                entities += some
        if entities != self._entities:
            self._entities = entities
            self._build()
        return not all(map(_begun, tasks)) or self._anything_ready()

    def _build(self) -> None:
        """Make wait sets of the size of what is there now."""
        handles: dict[str, list[Any]] = {kind: [] for kind in _KINDS}
        waitables: list[Any] = []
        for node in self._nodes:
            handles["subscription"] += [
                entity for entity in node.subscriptions if not isinstance(entity.callback_group, Unscheduled)
            ]
            handles["guard_condition"] += node.guards
            handles["timer"] += node.timers
            handles["client"] += node.clients
            handles["service"] += node.services
            waitables += node.waitables
        events = [entity for entity in waitables if isinstance(entity, EventHandler)]
        others = [entity for entity in waitables if not isinstance(entity, EventHandler)]
        context = self._nodes[0].context
        self._prompt = None
        try:
            prompt, self._events = _Look(context, handles, others), _Look(context, {}, events)
            prompt()
        except (ImportError, AttributeError, TypeError):
            return
        if prompt.sure:
            self._prompt = prompt

    def _anything_ready(self) -> bool:
        if self._prompt is None or self._events is None:
            return True
        self._looks += 1
        return self._prompt() or (self._looks % self._events_every == 0 and self._events())


def _begun(task: Any) -> bool:
    """Whether a task that is not done is a coroutine in the middle of its work."""
    handler = getattr(task, "_handler", None)
    return inspect.iscoroutine(handler) and inspect.getcoroutinestate(handler) != inspect.CORO_CREATED
