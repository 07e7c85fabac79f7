"""Rules of mixed traffic and of its messages, each taken out by hand, with the test that fails."""

from tests.faults.fault import Edit, Fault

AIR, LINK = "worlds/faults/air.py", "worlds/faults/link.py"
NEWEST = "worlds/faults/newest.py"
POSITIONS, ACTUATORS = "worlds/faults/positions.py", "worlds/faults/actuators.py"
ON_BOARD, LAWS = "mixed/on_board.py", "mixed/laws.py"
LANES, OF_LANES = "mixed/lanes.py", "tests/mixed/test_lanes_together.py"
SETUP, PLANT = "worlds/sumo/mixed_setup.py", "worlds/sumo/mixed_plant.py"
MOTION = "worlds/sumo/mixed_motion.py"
JUDGE, MIXED_RUNS = "checker/among_drivers.py", "runs/mixed.py"
OF_AIR, OF_LINKS = "tests/worlds/test_faulty_air.py", "tests/worlds/test_faulty_links.py"
OF_BOARD, OF_SLOW = "tests/mixed/test_on_board.py", "tests/mixed/test_slow_actuators.py"
OF_SETUP, OF_JUDGE = "tests/worlds/test_mixed_setup.py", "tests/checker/test_among_drivers.py"
OF_RUNS, OF_CARELESS = "tests/worlds/test_mixed_runs.py", "tests/worlds/test_careless.py"


def _fault(name: str, path: str, before: str, after: str, test: str) -> Fault:
    """A rule that is changed at one place, and the test that knows it."""
    return Fault(name, (Edit(path, before, after),), (), test)


PROTOCOL = (
    _fault(
        "reports are never stale",
        AIR,
        "fresh = (age_s <= self.scenario.reports.stale_s) & (station_m",
        "fresh = ~np.isnan(age_s) & (station_m",
        f"{OF_AIR}::test_stale_reports_are_forgotten",
    ),
    _fault(
        "an older report takes the place of a newer one",
        NEWEST,
        "if not rows[k, stamp] <= now[number, stamp]:",
        "if rows[k, stamp] == rows[k, stamp]:",
        f"{OF_AIR}::test_older_and_repeated_reports_change_nothing",
    ),
    _fault(
        "an older command takes the place of a newer one",
        NEWEST,
        "if not rows[k, stamp] <= now[number, stamp]:",
        "if rows[k, stamp] == rows[k, stamp]:",
        f"{OF_AIR}::test_older_and_repeated_commands_change_nothing",
    ),
    _fault(
        "reports are taken for what is now",
        AIR,
        "onwards(known[:, SPEED], known[:, ACCEL], age_s)",
        "onwards(known[:, SPEED], known[:, ACCEL], 0.0 * age_s)",
        f"{OF_AIR}::test_a_report_is_carried_on_from_its_stamp",
    ),
    _fault(
        "the acceleration that was reported is forgotten",
        AIR,
        "onwards(known[:, SPEED], known[:, ACCEL], age_s)",
        "onwards(known[:, SPEED], 0.0 * known[:, ACCEL], age_s)",
        f"{OF_AIR}::test_a_report_is_carried_on_with_the_acceleration_reported",
    ),
    _fault(
        "the strategy is shown where vehicles are, not where its commands find them",
        "worlds/sumo/mixed.py",
        "then = soon(seen, self.acts_after_s)",
        "then = soon(seen, 0.0)",
        f"{OF_RUNS}::test_the_strategy_is_shown_where_vehicles_will_be_when_its_commands_act",
    ),
    _fault(
        "who has no valid command gives up the room that it made",
        AIR,
        "np.where(holds, 0.0, np.inf)",
        "np.where(holds, np.inf, np.inf)",
        f"{OF_AIR}::test_who_was_to_make_room_keeps_it_for_a_while_after_its_command_has_expired",
    ),
    _fault(
        "vehicles try to keep less than the law on board allows",
        SETUP,
        "max(safety.time_gap_s, law.reaction_s + delay_s),",
        "safety.time_gap_s,",
        f"{OF_SETUP}::test_the_gap_that_is_kept_is_one_that_the_law_on_board_allows",
    ),
    _fault(
        "a stamp of the future carries a report back",
        AIR,
        "np.clip(now_s - known[:, STAMP], 0.0, None)",
        "now_s - known[:, STAMP]",
        f"{OF_AIR}::test_a_clock_that_is_wrong_shifts_the_stamp_and_so_the_station",
    ),
    _fault(
        "reports are carried on beyond the road",
        AIR,
        "& (station_m < end_m + BEYOND_M)",
        "& (station_m < end_m + 1e9)",
        f"{OF_AIR}::test_a_report_is_not_carried_on_far_beyond_the_road",
    ),
    _fault(
        "commands never expire",
        AIR,
        "valid = expired_s <= ROUNDING_S",
        "valid = expired_s <= 1e9",
        f"{OF_AIR}::test_an_overdue_command_leads_to_a_fallback_that_is_counted_once",
    ),
    _fault(
        "commands count from when they arrive",
        AIR,
        "            hears = now_s <",
        "            received[:, GIVEN] = now_s\n            hears = now_s <",
        f"{OF_AIR}::test_a_command_counts_from_when_it_was_given_not_from_when_it_arrived",
    ),
    _fault(
        "a fallback is counted at each look",
        AIR,
        "(overdue & ~self._overdue[users.number]).sum()",
        "overdue.sum()",
        f"{OF_AIR}::test_an_overdue_command_leads_to_a_fallback_that_is_counted_once",
    ),
    _fault(
        "who has no valid command waits for leave to merge",
        AIR,
        "alone = users.automated & ~obeys",
        "alone = users.automated & False",
        f"{OF_AIR}::test_a_vehicle_that_goes_by_itself_may_merge_where_it_sees_room",
    ),
    _fault(
        "who is told to wait merges",
        AIR,
        "alone | obeys & (command[:, MERGE] > 0.5)",
        "alone | obeys",
        f"{OF_AIR}::test_who_is_told_to_wait_may_not_merge",
    ),
    _fault(
        "who has fallen silent still reports",
        AIR,
        "due = self.reporting[number] & (now_s < self._silent_from_s[number])",
        "due = self.reporting[number] & True",
        f"{OF_AIR}::test_the_share_that_falls_silent_does_not_report_and_hears_nothing",
    ),
    _fault(
        "who has fallen silent still hears",
        AIR,
        "newest(self._command, received[hears], GIVEN)",
        "newest(self._command, received, GIVEN)",
        f"{OF_AIR}::test_the_share_that_falls_silent_does_not_report_and_hears_nothing",
    ),
    _fault(
        "who disobeys does as it is told",
        AIR,
        "obeys = valid & ~self._disobeys[users.number] & users.automated",
        "obeys = valid & users.automated",
        f"{OF_AIR}::test_the_share_that_disobeys_reports_but_does_not_do_what_it_is_told",
    ),
    _fault(
        "vehicles report before each decision whatever the period",
        AIR,
        "due &= now_s - self._reported_s[number] >= period_s - ROUNDING_S",
        "due &= now_s - self._reported_s[number] >= -ROUNDING_S",
        f"{OF_AIR}::test_a_vehicle_reports_once_a_period",
    ),
    _fault(
        "messages arrive at once",
        LINK,
        "there = self._due_s <= now_s + ROUNDING_S",
        "there = self._due_s <= now_s + 1e9",
        f"{OF_AIR}::test_a_command_acts_when_it_arrives",
    ),
    _fault(
        "messages arrive in the order in which they were sent",
        LINK,
        'order = np.argsort(self._due_s[there], kind="stable")',
        "order = np.arange(there.sum())",
        f"{OF_LINKS}::test_messages_are_handed_over_in_the_order_in_which_they_arrived",
    ),
    _fault(
        "drivers who are not connected are known",
        "worlds/sumo/mixed.py",
        "heard = automated | connected_of(scenario, arrivals, seed)",
        "heard = automated | True",
        f"{OF_RUNS}::test_a_driver_who_is_not_connected_is_not_known_to_the_strategy",
    ),
    _fault(
        "a bias is taken off what is reported",
        POSITIONS,
        "section.bias_m + self._error_m[number]",
        "0.0 * section.bias_m + self._error_m[number]",
        f"{OF_AIR}::test_a_bias_of_20_m_is_20_m_in_what_the_coordinator_hears",
    ),
)
"""The rules by which messages count, and what vehicles do without them."""

PROMISES = (
    _fault(
        "automated vehicles reckon with the leader's stop as if it braked at half of b",
        ON_BOARD,
        "leader_mps**2 / (2.0 * law.braking_mps2)",
        "leader_mps**2 / (1.0 * law.braking_mps2)",
        f"{OF_BOARD}::test_the_largest_speed_that_keeps_the_distance",
    ),
    _fault(
        "the way until it reacts is left out of the distance",
        ON_BOARD,
        "left_m -= 0.5 * speed_mps * reaction_s",
        "left_m -= 0.0 * speed_mps * reaction_s",
        f"{OF_BOARD}::test_the_largest_speed_that_keeps_the_distance",
    ),
    _fault(
        "what a vehicle is told counts more than its distance",
        ON_BOARD,
        "            accel = min(accel, _behind_mps2(users, own, leader, ahead, laws))\n",
        "            accel = min(told_mps2[own], accel)\n",
        f"{OF_BOARD}::test_who_keeps_the_distance_never_touches_a_leader_that_brakes_at_most_at_b",
    ),
    _fault(
        "what a vehicle is told does not lower its acceleration",
        ON_BOARD,
        "accel = min(told_mps2[own], _alone_mps2(users, own, ahead, laws))",
        "accel = _alone_mps2(users, own, ahead, laws)",
        f"{OF_BOARD}::test_what_is_told_lowers_the_acceleration_and_never_raises_it",
    ),
    _fault(
        "who changes lanes looks at its old leader alone",
        ON_BOARD,
        "if changes[own] and around.front[own] >= 0:",
        "if changes[own] and around.front[own] >= 10**9:",
        f"{OF_BOARD}::test_who_changes_lanes_keeps_the_distance_in_both",
    ),
    _fault(
        "who is behind a lane change reacts only after it",
        ON_BOARD,
        "if changes[own] and rear >= 0 and users.automated[rear]:",
        "if changes[own] and rear >= 10**9 and users.automated[rear]:",
        f"{OF_BOARD}::test_who_is_behind_a_lane_change_brakes_with_it",
    ),
    _fault(
        "a lane change leaves no room for a driver behind",
        ON_BOARD,
        "return bool(free_m >= max(near_m, needs_m))",
        "return bool(free_m >= near_m)",
        f"{OF_BOARD}::test_a_driver_behind_need_not_brake_harder_than_in_comfort",
    ),
    _fault(
        "a driver who moves is left less than his standstill gap",
        ON_BOARD,
        "near_m = min(gaps.of_driver_m,",
        "near_m = min(0.0,",
        f"{OF_BOARD}::test_a_driver_who_moves_is_left_his_standstill_gap_at_least",
    ),
    _fault(
        "a faster vehicle asks the driver ahead for room",
        ON_BOARD,
        "            asks[own] = users.speed_mps[own] <= users.speed_mps[ahead]",
        "            asks[own] = True",
        f"{OF_BOARD}::test_who_is_faster_than_the_driver_ahead_asks_nobody_for_room",
    ),
    _fault(
        "who merges at the lane's end leaves a driver less than anybody keeps",
        ON_BOARD,
        "shorter_s = (gaps.of_driver_s - gaps.least_of_driver_s) * share * share",
        "shorter_s = gaps.of_driver_s * share * share",
        f"{OF_BOARD}::test_a_driver_behind_is_left_what_drivers_keep_on_average_and_at_the_end_the_least",
    ),
    _fault(
        "a lane change looks at nobody in front",
        ON_BOARD,
        "if front >= 0 and not _may_be_behind(users, own, front, own, ahead, laws):",
        "if front >= 10**9 and not _may_be_behind(users, own, front, own, ahead, laws):",
        f"{OF_BOARD}::test_no_lane_change_too_near_to_the_vehicle_in_front_or_an_automated_one_behind",
    ),
    _fault(
        "a lane change looks at no automated vehicle behind",
        ON_BOARD,
        "return _may_be_behind(users, rear, own, own, ahead, laws)",
        "return True",
        f"{OF_BOARD}::test_no_lane_change_too_near_to_the_vehicle_in_front_or_an_automated_one_behind",
    ),
    _fault(
        "vehicles change lanes before the nose",
        ON_BOARD,
        "if users.on_mainline[own] or users.station_m[own] < READY_M:",
        "if users.on_mainline[own]:",
        f"{OF_BOARD}::test_nobody_changes_lanes_before_the_nose_or_from_the_mainline",
    ),
    _fault(
        "nobody stops before the acceleration lane ends",
        ON_BOARD,
        "        accel = min(accel, (stops_mps - speed_mps) / period_s)\n",
        "        accel = min(accel, accel)\n",
        f"{OF_BOARD}::test_who_does_not_merge_stands_before_the_lane_ends",
    ),
    _fault(
        "one merges ahead of a vehicle that stops only beyond it",
        ON_BOARD,
        "if keeps_mps == 0.0 and free_m - ahead.way_m[rear] < touching_m:",
        "if keeps_mps == 0.0 and free_m < touching_m:",
        f"{OF_SLOW}::test_nobody_merges_ahead_of_one_that_could_only_stop_beyond",
    ),
    _fault(
        "the way until a command acts is not reckoned with",
        ON_BOARD,
        "        free_m - ahead.way_m[own],\n",
        "        free_m,\n",
        f"{OF_SLOW}::test_the_distance_holds_under_dead_time_and_lag",
    ),
    _fault(
        "commands that are under way are forgotten",
        ACTUATORS,
        "for due in self._queue[:, number]:",
        "for due in self._queue[:0, number]:",
        f"{OF_SLOW}::test_the_point_ahead_follows_commands_at_once",
    ),
    _fault(
        "the lag is not predicted",
        ACTUATORS,
        "        lag_s = self._lag_s\n        way_m = way_m",
        "        lag_s = 0.0\n        way_m = way_m",
        f"{OF_SLOW}::test_the_point_ahead_follows_commands_at_once",
    ),
    _fault(
        "vehicles brake harder than the road lets them",
        ACTUATORS,
        "due_mps2 = np.maximum(due_mps2, -self.most_braking_mps2)",
        "due_mps2 = np.maximum(due_mps2, -99.0)",
        f"{OF_SLOW}::test_nobody_brakes_harder_than_adhesion_allows",
    ),
    _fault(
        "who is commanded rarely reckons with reacting sooner",
        SETUP,
        "reaction_s=max(law.reaction_s, period_s)",
        "reaction_s=law.reaction_s",
        f"{OF_SETUP}::test_nobody_reckons_with_reacting_before_the_next_command",
    ),
    _fault(
        "the margin leaves out what drivers in Euler steps stop shorter",
        SETUP,
        "margin_m=max(law.margin_m, shorter_m)",
        "margin_m=law.margin_m",
        f"{OF_SETUP}::test_the_margin_holds_what_drivers_in_euler_steps_stop_shorter",
    ),
    _fault(
        "a slippery road is taken for a dry one",
        LAWS,
        "braking_mps2=min(self.braking_mps2, most_braking_mps2)",
        "braking_mps2=self.braking_mps2",
        f"{OF_SETUP}::test_on_a_slippery_road_nobody_is_taken_to_brake_harder_than_it_lets_them",
    ),
    _fault(
        "a heavy vehicle reckons with a car's brakes",
        SETUP,
        "most_mps2 if np.isinf(t.braking_mps2) else max(t.braking_mps2, TRUCK_BRAKING_MPS2)",
        "most_mps2",
        f"{OF_SETUP}::test_a_heavy_vehicle_reckons_with_its_own_brakes",
    ),
    _fault(
        "SUMO's drivers see shorter gaps than late vehicles keep",
        SETUP,
        "kept_gap(scenario, safety_law_of(scenario, period_s), delay_s)",
        "kept_gap(scenario, safety_law_of(scenario, period_s), 0.0)",
        f"{OF_SETUP}::test_drivers_see_gaps_that_are_kept_at_least",
    ),
    _fault(
        "where a vehicle was sent is not compared with where it is",
        MOTION,
        "error_m = abs(station_m[k] - motion.sent_m[own])",
        "error_m = 0.0 * station_m[k]",
        "tests/worlds/test_off_course.py::test_a_vehicle_that_is_not_where_it_was_sent_is_found",
    ),
    _fault(
        "a run that left its course is as good as any",
        MIXED_RUNS,
        '(row.get("plan_error_m") or 0.0) > LARGEST_PLAN_ERROR_M',
        '(row.get("plan_error_m") or 0.0) > 1e9',
        "tests/worlds/test_off_course.py::test_a_run_off_course_breaks_its_promise",
    ),
    _fault(
        "ballistic drivers are let in",
        MIXED_RUNS,
        'if scenario.has_automated and integrator != "euler":',
        'if scenario.has_automated and integrator == "neither":',
        "tests/edges/test_mixed_input.py::test_what_mixed_traffic_cannot_do_is_told",
    ),
    _fault(
        "who reacts too late for the lane is let in",
        MIXED_RUNS,
        "if delay_s == 0.0 or delay_s <= most_s:",
        "if delay_s >= 0.0 or delay_s <= most_s:",
        "tests/edges/test_world_input.py"
        "::test_a_lag_that_no_plan_can_absorb_is_refused_with_the_largest_that_can_be",
    ),
    _fault(
        "SUMO takes ballistic steps where drivers look rarely",
        "worlds/sumo/files.py",
        "        result += self._step_method\n",
        "        result += self._step_method if self._ballistic else ()\n",
        f"{OF_CARELESS}::test_who_looks_rarely_leaves_all_in_euler_steps",
    ),
    _fault(
        "SUMO moves automated vehicles off the mainline",
        PLANT,
        "        if on_mainline:\n            self.session.take_over(name)",
        "        if on_mainline:\n            self.session.take_over_among_drivers(name)",
        f"{OF_RUNS}::test_no_automated_vehicle_leaves_the_mainline",
    ),
)
"""What the claim of safety rests on, and what enforces it."""

VERDICTS = (
    _fault(
        "who pushes in before a driver is not to blame for his running into it",
        JUDGE,
        "return BY_AUTOMATED if pushed else BY_DRIVER",
        "return BY_DRIVER",
        f"{OF_JUDGE}::test_a_driver_who_hits_whoever_pushed_in_is_not_to_blame",
    ),
    _fault(
        "a driver who cuts in is not seen",
        JUDGE,
        "cut_in = short & came_in[pairs.front] & ~seen.automated[front]",
        "cut_in = short & False",
        f"{OF_JUDGE}::test_a_collision_after_a_cut_in_is_the_drivers",
    ),
    _fault(
        "a driver who brakes harder than b is not seen",
        JUDGE,
        "hard &= braking_mps2[pairs.front] > limits.braking_mps2 + EXACT_MPS2",
        "hard &= braking_mps2[pairs.front] > 1e9",
        f"{OF_JUDGE}::test_a_collision_after_harder_braking_is_the_drivers",
    ),
    _fault(
        "a distance that is not kept is not seen",
        JUDGE,
        "short = keeps & (_spare_m(seen, pairs, limits) < -EXACT_M)",
        "short = keeps & (_spare_m(seen, pairs, limits) < -99.0)",
        f"{OF_JUDGE}::test_a_promise_of_distance_that_is_not_kept_is_found_without_a_collision",
    ),
    _fault(
        "what a driver did long ago still excuses",
        JUDGE,
        "and deed.time_s <= time_s <= deed.time_s + REMEMBERED_S",
        "and deed.time_s <= time_s",
        f"{OF_JUDGE}::test_what_a_driver_did_excuses_nothing_much_later",
    ),
    _fault(
        "who pushes in before a driver is not seen",
        JUDGE,
        "return np.asarray(found & (pairs.gap_m < needs_m - 2.0 * EXACT_M))",
        "return np.asarray(found & (pairs.gap_m < -99.0))",
        f"{OF_JUDGE}::test_who_pushes_in_before_a_driver_is_found",
    ),
)
"""What the checker names."""

MAKING_WAY = (
    _fault(
        "two make way into one gap",
        LANES,
        "            taken[gap] = True",
        "            taken[gap] = False",
        f"{OF_LANES}::test_who_makes_way_has_a_gap_to_itself_and_is_told_to_slow_down",
    ),
    _fault(
        "who gets a new leader makes way at the same time",
        LANES,
        "held[around.rear[own]] = False",
        "held[around.rear[own]] = held[around.rear[own]]",
        f"{OF_LANES}::test_who_makes_way_has_a_gap_to_itself_and_is_told_to_slow_down",
    ),
    _fault(
        "who has no lane beside it makes way",
        LANES,
        "== OUTERMOST) & lanes.beside",
        "== OUTERMOST)",
        f"{OF_LANES}::test_who_makes_way_has_a_gap_to_itself_and_is_told_to_slow_down",
    ),
    _fault(
        "a driver behind is judged by what who makes way was told, not by what it does",
        LANES,
        "min(0.0, both_mps2[own]) * endless",
        "min(0.0, told_mps2[own]) * endless",
        f"{OF_LANES}::test_a_driver_behind_need_not_brake_harder_than_in_comfort",
    ),
    _fault(
        "an automated vehicle behind who makes way is not asked",
        ON_BOARD,
        "    return _may_be_behind(users, rear, own, own, ahead, laws)\n",
        "    return True\n",
        f"{OF_LANES}::test_every_automated_vehicle_keeps_the_distance_that_it_needs_on_each_of_its_lanes",
    ),
    _fault(
        "who is behind a lane change drives on as before",
        ON_BOARD,
        "        if changes[own] and rear >= 0 and users.automated[rear]:",
        "        if changes[own] and rear >= len(users.number) and users.automated[rear]:",
        f"{OF_LANES}::test_every_automated_vehicle_keeps_the_distance_that_it_needs_on_each_of_its_lanes",
    ),
    _fault(
        "nobody gains by making way",
        LANES,
        "or inner_mps2[own] < told_mps2[own] + GAIN_MPS2",
        "or inner_mps2[own] < -99.0",
        "tests/mixed/test_lanes.py::test_nobody_makes_way_who_would_have_to_brake_as_much_further_in",
    ),
)
"""Rules of making way on several lanes."""

MIXED_FAULTS = (*PROTOCOL, *PROMISES, *VERDICTS, *MAKING_WAY)
