#!/bin/busybox sh
# The first process of the guest: runs /program with the words of /words, a line each, and says
# how it has ended. What it prints goes to the first port, its exit code to the second.
b=/bin/busybox
$b mount -t proc none /proc
$b mount -t sysfs none /sys
$b mount -t devtmpfs none /dev
exec >/dev/ttyS0 2>&1
finish() {
	echo "$1" >/dev/vport0p2
	$b poweroff -f
}
$b sysctl -q -w kernel.sched_rt_runtime_us=-1
# A kernel that has just started is late by tens of milliseconds for some seconds.
$b sleep 3
if [ -f /policy.o ]; then
	$b mount -t bpf none /sys/fs/bpf
	bpftool struct_ops register /policy.o || finish refused
fi
i=0
while [ $i -lt "$($b cat /busy)" ]; do
	while :; do :; done &
	i=$((i + 1))
done
set -f
IFS='
'
/program $($b cat /words) >/dev/vport0p1 2>/dev/ttyS0
code=$?
if [ -f /policy.o ]; then
	# The end of the program is the policy's; it takes the kernel a moment.
	$b sleep 1
	$b dmesg | $b grep sched_ext:
	if $b dmesg | $b grep -q 'disabled (run'; then code=ejected; fi
	if [ "$($b cat /sys/kernel/sched_ext/state)" != disabled ]; then code=left; fi
fi
finish $code
