#!/usr/bin/env bash
# Start the nodes under test on the graph of ROS_MASTER_URI; they live until Ctrl-C, and serve one test run after the other.
# PARCOURS names a Python that has Parcours and sees ROS 1; more arguments go to `parcours nodes`.
arguments=()
for one in "$@"; do
  case "$one" in *:=*) ;; *) arguments+=("$one") ;; esac  # what roslaunch adds
done
master="${ROS_MASTER_URI:-http://127.0.0.1:11311}"
exec "${PARCOURS:-python3}" -m parcours nodes ramp_components --master "$master" "${arguments[@]}"
