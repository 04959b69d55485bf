"""Telling cheaply whether an executor would find anything to do.

An executor builds a wait set over every entity of its nodes each time it is asked, in Python. For the simulator this
takes 240 us, with the wait set here 110: 24 of its 35 entities are events of the middleware. This one is built once,
and again only when entities come or go. Wait sets are no documented surface of rclpy; where they are not there, the
executor is asked.
"""

import inspect
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from rclpy.node import Node

from .direct import Unscheduled

_KINDS = ("subscription", "guard_condition", "timer", "client", "service")
"""What a wait set can list as ready, in the order of its constructor; events are the sixth and are asked one by one."""


class Waiting:
    """Tells whether an executor would find anything to do, at half the price of asking it.

    Parameters
    ----------
    nodes : sequence of Node
        All that they have counts, inboxes left out: subscriptions, timers, clients, services, guard conditions, and
        waitables, which are action servers, action clients and events. What is created or destroyed later counts from
        then on.
    """

    def __init__(self, nodes: Sequence[Node]) -> None:
        self._nodes = nodes
        self._executor: Any = nodes[0].executor
        self._entities: list[Any] = []
        self._guards: list[Any] = []
        self._kinds: list[str] = []
        self._events = 0
        self._add: list[Callable[[], object]] = []
        self._set: Any = None
        self._sure = True  # False: only the executor can tell
        self.unfinished = False
        """Whether tasks have begun and not ended: coroutines that the executor has to resume now and then."""
        self()

    def __call__(self) -> bool:
        """Whether anything is ready, or a task has not begun; always true where it cannot be told cheaply."""
        tasks = [task for task, *_ in getattr(self._executor, "_tasks", ()) if not task.done()]
        self.unfinished = any(map(_begun, tasks))
        entities: list[Any] = []
        for node in self._nodes:
            for some in (node.subscriptions, node.guards, node.timers, node.clients, node.services, node.waitables):
                entities += some
        if entities != self._entities:
            self._entities = entities
            self._build()
        return not all(map(_begun, tasks)) or not self._sure or self._anything_ready()

    def _build(self) -> None:
        """Make a wait set of the size of what is there now, and list what goes into it."""
        kinds: dict[str, list[Any]] = {kind: [] for kind in _KINDS}
        waitables: list[Any] = []
        for node in self._nodes:
            kinds["subscription"] += [
                entity for entity in node.subscriptions if not isinstance(entity.callback_group, Unscheduled)
            ]
            kinds["guard_condition"] += node.guards
            kinds["timer"] += node.timers
            kinds["client"] += node.clients
            kinds["service"] += node.services
            waitables += node.waitables
        needed = [entity.get_num_entities() for entity in waitables]
        sizes = {kind: len(some) + sum(getattr(n, f"num_{kind}s") for n in needed) for kind, some in kinds.items()}
        self._events = sum(n.num_events for n in needed)
        self._guards = kinds["guard_condition"]
        # A look takes the trigger of a guard condition away. One of ours is triggered again; one that is hidden in a
        # waitable cannot be.
        self._sure = sizes["guard_condition"] == len(self._guards)
        self._kinds = [kind for kind, size in sizes.items() if size]
        try:
            from rclpy.impl.implementation_singleton import rclpy_implementation

            self._set = rclpy_implementation.WaitSet(*sizes.values(), self._events, self._nodes[0].context.handle)
            self._add = [
                partial(getattr(self._set, f"add_{kind}"), entity.handle)
                for kind, some in kinds.items()
                for entity in some
            ]
            self._add += [partial(entity.add_to_wait_set, self._set) for entity in waitables]
            self._anything_ready()
        except (ImportError, AttributeError, TypeError):
            self._sure = False

    def _anything_ready(self) -> bool:
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


def _begun(task: Any) -> bool:
    """Whether a task that is not done is a coroutine in the middle of its work."""
    handler = getattr(task, "_handler", None)
    return inspect.iscoroutine(handler) and inspect.getcoroutinestate(handler) != inspect.CORO_CREATED
