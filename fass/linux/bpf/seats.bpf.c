// Seats: who has a core, as the program that runs DAGs decides, for Linux to carry out.
//
// The program has a byte for each thread in a table that it shares with this policy of
// sched_ext. On a core a higher byte comes before a lower one; 0 is a thread of anybody's, and those
// share what is left. A thread's core is the processor that it is pinned to. Nothing here knows
// of DAGs.
//
// To raise or lower a thread is a store, without a system call. It counts from the next time that
// the core is given away: at once where a thread that comes before the occupant wakes up, which
// is what a preemption begins with, or else when the occupant waits.
//
// Every thread waits in a queue of ours until its core asks for the best. Were one put into the
// kernel's own queue of a core before that, nobody could come before it any more.
//
// It takes Linux 6.13, and no header of a kernel: what is declared here is a part of what the
// kernel has, and found there by name when this is loaded.

typedef unsigned char __u8;
typedef unsigned short __u16;
typedef unsigned int __u32;
typedef unsigned long long __u64;
typedef signed int __s32;
typedef signed long long __s64;
typedef __u16 __be16;
typedef __u32 __be32;
typedef __u32 __wsum;
typedef _Bool bool;

enum { BPF_MAP_TYPE_ARRAY = 2, BPF_F_MMAPABLE = 1024 };

#include <bpf/bpf_helpers.h>
#include <bpf/bpf_tracing.h>

#define FROM_KERNEL __attribute__((preserve_access_index))

struct sched_ext_entity {
	__u32 flags;
	__u64 slice;
} FROM_KERNEL;

struct task_struct {
	int pid;
	struct sched_ext_entity scx;
} FROM_KERNEL;

struct scx_exit_task_args;

struct bpf_iter_scx_dsq {
	__u64 opaque[6];
};

__s32 scx_bpf_create_dsq(__u64 queue, __s32 node) __ksym;
void scx_bpf_dsq_insert(struct task_struct *thread, __u64 queue, __u64 slice, __u64 flags) __ksym;
bool scx_bpf_dsq_move(struct bpf_iter_scx_dsq *at, struct task_struct *thread, __u64 queue,
		      __u64 flags) __ksym;
bool scx_bpf_dsq_move_to_local(__u64 queue) __ksym;
__s32 scx_bpf_task_cpu(const struct task_struct *thread) __ksym;
__s32 scx_bpf_select_cpu_dfl(struct task_struct *thread, __s32 before, __u64 flags,
			     bool *is_idle) __ksym;
void scx_bpf_kick_cpu(__s32 core, __u64 flags) __ksym;
void scx_bpf_exit_bstr(__s64 code, char *text, unsigned long long *values, __u32 bytes) __ksym;
int bpf_iter_scx_dsq_new(struct bpf_iter_scx_dsq *at, __u64 queue, __u64 flags) __ksym;
struct task_struct *bpf_iter_scx_dsq_next(struct bpf_iter_scx_dsq *at) __ksym;
void bpf_iter_scx_dsq_destroy(struct bpf_iter_scx_dsq *at) __ksym;

// The kernel's own constants.
#define IS_QUEUED 1
#define PREEMPT 2
#define THIS_CORE ((__u64)1 << 63 | 2)
#define ENDLESS (~(__u64)0)

// No kernel numbers more threads. A queue for each core, and one for the threads of rank 0.
#define THREADS (1 << 22)
#define CORES 256
#define OTHERS CORES
// For how long one of those has a core before the next one has it, in nanoseconds.
#define SHARE 5000000

// What the program shares: `fass/linux/src/level.rs` has the same.
struct seats {
	__u8 ranks[THREADS];
	// The number of the program, with whose end the policy is unloaded.
	__u32 owner;
	// The thread that has a core, by core; 0: none of ours.
	__u32 occupants[CORES];
};

struct {
	__uint(type, BPF_MAP_TYPE_ARRAY);
	__uint(map_flags, BPF_F_MMAPABLE);
	__uint(max_entries, 1);
	__type(key, __u32);
	__type(value, struct seats);
	__uint(pinning, LIBBPF_PIN_BY_NAME);
} fass_seats SEC(".maps");

static struct seats *shared(void)
{
	__u32 first = 0;

	return bpf_map_lookup_elem(&fass_seats, &first);
}

static __u32 rank_of(struct seats *seats, __u32 thread)
{
	return seats->ranks[thread % THREADS];
}

static __u32 core_of(struct task_struct *thread)
{
	return (__u32)scx_bpf_task_cpu(thread) % CORES;
}

// Without this, the kernel would put a thread that finds its core idle into the core's own queue.
SEC("struct_ops/select_cpu")
__s32 BPF_PROG(select_core, struct task_struct *thread, __s32 before, __u64 flags)
{
	bool is_idle = 0;

	return scx_bpf_select_cpu_dfl(thread, before, flags, &is_idle);
}

SEC("struct_ops/enqueue")
void BPF_PROG(enqueue, struct task_struct *thread, __u64 flags)
{
	struct seats *seats = shared();
	__u32 core = core_of(thread), rank;

	if (!seats)
		return;
	rank = rank_of(seats, thread->pid);
	if (!rank) {
		scx_bpf_dsq_insert(thread, OTHERS, SHARE, flags);
		return;
	}
	scx_bpf_dsq_insert(thread, core, ENDLESS, flags);
	if (rank > rank_of(seats, seats->occupants[core]))
		scx_bpf_kick_cpu(core, PREEMPT);
}

SEC("struct_ops/dispatch")
void BPF_PROG(dispatch, __s32 number, struct task_struct *before)
{
	struct seats *seats = shared();
	struct bpf_iter_scx_dsq at;
	struct task_struct *thread;
	__u32 core = (__u32)number % CORES, best = 0;
	int chosen = 0;

	if (!seats)
		return;
	if (before && before->scx.flags & IS_QUEUED)
		best = rank_of(seats, before->pid);
	bpf_iter_scx_dsq_new(&at, core, 0);
	while ((thread = bpf_iter_scx_dsq_next(&at))) {
		__u32 rank = rank_of(seats, thread->pid);

		if (rank > best) {
			best = rank;
			chosen = thread->pid;
		}
	}
	bpf_iter_scx_dsq_destroy(&at);
	if (chosen) {
		bpf_iter_scx_dsq_new(&at, core, 0);
		while ((thread = bpf_iter_scx_dsq_next(&at)))
			if (thread->pid == chosen)
				scx_bpf_dsq_move(&at, thread, THIS_CORE, 0);
		bpf_iter_scx_dsq_destroy(&at);
	} else if (before && best) {
		before->scx.slice = ENDLESS;
	} else if (!scx_bpf_dsq_move_to_local(OTHERS)) {
		// One that was put down to rank 0 while it waited.
		scx_bpf_dsq_move_to_local(core);
	}
}

SEC("struct_ops/running")
void BPF_PROG(running, struct task_struct *thread)
{
	struct seats *seats = shared();

	if (seats)
		seats->occupants[core_of(thread)] = thread->pid;
}

SEC("struct_ops/stopping")
void BPF_PROG(stopping, struct task_struct *thread, bool is_runnable)
{
	struct seats *seats = shared();

	if (seats)
		seats->occupants[core_of(thread)] = 0;
}

// One that was put down to rank 0 while it had its core shares it from now on.
SEC("struct_ops/tick")
void BPF_PROG(tick, struct task_struct *thread)
{
	struct seats *seats = shared();

	if (seats && !rank_of(seats, thread->pid) && thread->scx.slice > SHARE)
		thread->scx.slice = SHARE;
}

// Thread numbers are used again.
SEC("struct_ops/enable")
void BPF_PROG(enable, struct task_struct *thread)
{
	struct seats *seats = shared();

	if (seats)
		seats->ranks[(__u32)thread->pid % THREADS] = 0;
}

static char why[] = "its program has ended";

SEC("struct_ops/exit_task")
void BPF_PROG(exit_task, struct task_struct *thread, struct scx_exit_task_args *args)
{
	struct seats *seats = shared();
	unsigned long long none = 0;

	if (seats && seats->owner == (__u32)thread->pid) {
		seats->owner = 0;
		scx_bpf_exit_bstr(0, why, &none, sizeof(none));
	}
}

SEC("struct_ops.s/init")
__s32 BPF_PROG(init)
{
	struct seats *seats = shared();
	__s32 error = 0;
	__u32 queue;

	if (seats)
		seats->owner = 0;
	for (queue = 0; queue <= OTHERS && !error; queue++)
		error = scx_bpf_create_dsq(queue, -1);
	return error;
}

struct sched_ext_ops {
	__s32 (*select_cpu)(struct task_struct *thread, __s32 before, __u64 flags);
	void (*enqueue)(struct task_struct *thread, __u64 flags);
	void (*dispatch)(__s32 core, struct task_struct *before);
	void (*running)(struct task_struct *thread);
	void (*stopping)(struct task_struct *thread, bool is_runnable);
	void (*tick)(struct task_struct *thread);
	void (*enable)(struct task_struct *thread);
	void (*exit_task)(struct task_struct *thread, struct scx_exit_task_args *args);
	__s32 (*init)(void);
	__u32 timeout_ms;
	char name[128];
};

SEC(".struct_ops")
struct sched_ext_ops fass_seats_ops = {
	.select_cpu = (void *)select_core,
	.enqueue = (void *)enqueue,
	.dispatch = (void *)dispatch,
	.running = (void *)running,
	.stopping = (void *)stopping,
	.tick = (void *)tick,
	.enable = (void *)enable,
	.exit_task = (void *)exit_task,
	.init = (void *)init,
	// The longest that a kernel lets a runnable thread wait before it unloads a policy.
	.timeout_ms = 30000,
	.name = "fass_seats",
};

char terms[] SEC("license") = "GPL";
