"""FMUs that attack what runs them: C for `fmus.library`, and what may be seen of each afterwards.

Every attack begins after 4.5 ms of the FMU's time. `MARK` is a folder of the test: its path is in the command line and
the environment of everything that the test starts, and of nothing else.
"""

from __future__ import annotations

import os
from pathlib import Path

SECRET = "a-token-that-no-fmu-may-see"
PRELUDE = r"""
#define _GNU_SOURCE
#include <dirent.h>
#include <fcntl.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>
/* An answer as skillframe's own worker would send it: token from our command line, number of the message, length. */
static void forge(unsigned number, unsigned declared, const char *body, unsigned n) {
    char line[65536] = {0}, message[70000];
    int from = open("/proc/self/cmdline", O_RDONLY);
    long size = read(from, line, sizeof line - 1);
    close(from);
    for (long k = 0; k < size; k++) if (!line[k]) line[k] = ' ';
    char *at = strstr(line, "\"token\": ");
    uint64_t token = at ? strtoull(at + 9, NULL, 10) : 0;
    uint32_t head[2] = {number, declared};
    unsigned char old[4] = {declared >> 24, declared >> 16, declared >> 8, declared};
    int begin = at ? 16 : 4;
    if (at) { memcpy(message, &token, 8); memcpy(message + 8, head, 8); } else memcpy(message, old, 4);
    memcpy(message + begin, body, n);
    for (int fd = 3; fd < 30000; fd++) {
        struct stat s;
        if (!fstat(fd, &s) && S_ISSOCK(s.st_mode)) send(fd, message, begin + n, MSG_NOSIGNAL | MSG_DONTWAIT);
    }
}
static void put(const char *folder, const char *text) {
    char path[4096];
    snprintf(path, sizeof path, "%s/%s", folder, NAME);
    FILE *f = fopen(path, "w");
    if (f) { fputs(text, f); fclose(f); }
}
static void hunt(const char *mark) {
    DIR *all = opendir("/proc");
    for (struct dirent *e; (e = readdir(all));) {
        char path[300], line[65536] = {0};
        snprintf(path, sizeof path, "/proc/%s/cmdline", e->d_name);
        int fd = open(path, O_RDONLY), pid = atoi(e->d_name);
        long size = fd < 0 ? 0 : read(fd, line, sizeof line - 1);
        if (fd >= 0) close(fd);
        for (long k = 0; k < size; k++) if (!line[k]) line[k] = ' ';
        if (pid > 1 && pid != getpid() && strstr(line, mark)) kill(pid, SIGKILL);
    }
}
static int steps;
static void attack(double t);
"""
AT = "steps++;if(t>0.0045)attack(t);"
FINE = ""
STOPPED = r"did not answer within 3 s while .*; it was stopped"
CLOSED = "closed its end of the pipe and was stopped while"
LIAR = r"sent .* instead of an answer while .*; it was stopped"


class Attack:
    """C of `attack`, the words of the sentence by command ("" where all goes well), and what hooks call it."""

    def __init__(self, code, check, simulate=None, hooks=None, before=""):
        self.code, self.check, self.simulate = code, check, check if simulate is None else simulate
        self.hooks, self.before = hooks or {"ON_STEP": AT}, before

    def source(self, mark: Path) -> str:
        """The prelude and this attack."""
        names = f'#define MARK "{mark}"\n#define NAME "{_name(mark)}"\n'
        return names + PRELUDE + f"{self.before}\nstatic void attack(double t) {{ {self.code} }}\n"


ONCE = "static int done;if(done++)return;"
ATTACKS = {
    "stray bytes to small descriptors": Attack(
        'for(int fd=0;fd<1024;fd++)if(write(fd,"\\0\\0\\0\\5.evil and more",18)<0){}', FINE
    ),
    "stray bytes to every descriptor": Attack(
        'for(int fd=0;fd<30000;fd++)if(write(fd,"\\0\\0\\0\\5.evil and more and more",27)<0){}', LIAR
    ),
    "half a message": Attack(
        'for(int fd=3;fd<30000;fd++){struct stat s;if(!fstat(fd,&s)&&S_ISSOCK(s.st_mode))'
        'if(write(fd,"\\0\\0\\1",3)<0){}}for(;;)sleep(1);', STOPPED,
    ),
    "a message of 4 GB announced": Attack('forge(CHECK?2:steps+1,0x7fffffff,".",1);for(;;)sleep(1);', LIAR),
    "never answers": Attack("for(;;);", STOPPED),
    "sleeps in its set-up": Attack("for(;;)sleep(100);", STOPPED, hooks={"ON_SETUP": "attack(0);"}),
    "closes every descriptor": Attack(
        "close_range(0,~0U,0);", r"(left with code \d+|closed its end of the pipe and was stopped|crashed).* while "
    ),
    "closes every descriptor, and goes on": Attack("close_range(0,~0U,0);for(;;)sleep(1);", CLOSED),
    "leaves in a step": Attack("exit(0);", "left with code 0 while"),
    "aborts": Attack("abort();", r"crashed \(SIGABRT\) while"),
    "segment violation": Attack("*(volatile int*)8=1;", r"crashed \(SIGSEGV\) while"),
    "a grandchild that outlives it": Attack(
        ONCE + "int p=fork();if(p<0)abort();"
        'if(p==0){setsid();if(fork()==0)for(;;){put(MARK,"later");usleep(200000);}_exit(0);}',
        FINE,
    ),
    "a hundred children": Attack(
        ONCE + "for(int i=0;i<100;i++){int p=fork();if(p<0)abort();if(p==0){setsid();for(;;)sleep(1);}}", FINE
    ),
    "a hundred children, and never answers": Attack(
        "for(int i=0;i<100;i++){int p=fork();if(p<0)abort();if(p==0){setsid();for(;;)sleep(1);}}for(;;)sleep(1);",
        STOPPED,
    ),
    "kills its parent": Attack("kill(getppid(),SIGKILL);sleep(1);", r"crashed \(SIGKILL\) while"),
    "kills what it finds": Attack("hunt(MARK);", FINE),
    "writes files": Attack(
        'put(".","x");put(MARK,"x");put("/tmp","x");put("/var/tmp","x");if(getenv("HOME"))put(getenv("HOME"),"x");'
        'if(access(NAME,R_OK))abort();',
        FINE,
    ),
    "writes the environment's secrets": Attack(
        'if(getenv("SKILLFRAME_TEST_SECRET")){put(MARK,getenv("SKILLFRAME_TEST_SECRET"));abort();}', FINE
    ),
    "takes all memory": Attack(
        "for(;;){char*p=malloc(1<<26);if(!p)abort();memset(p,1,1<<26);}",
        r"crashed \(SIG(SEGV|KILL|ABRT), having used \d{3,4} MB of 2048 MB\)|" + STOPPED,  # on a busy machine
    ),
    "a forged row": Attack('forge(CHECK?2:steps+1,11,".[0.5, 1e9]",11);', LIAR),
    "a forged number that is none": Attack(
        'const char*r=CHECK?".NaN":".[0.0065, NaN, false, 6, \\"hello\\"]";int n=strlen(r);'
        "forge(CHECK?2:steps+1,n,r,n);",
        LIAR,
    ),
    "a forged end": Attack('forge(CHECK?2:steps+1,3,".[]",3);', LIAR),
    "floods its outputs and its folder": Attack(
        ONCE + "static char b[1<<20];memset(b,65,sizeof b);"
        "for(int i=0;i<64;i++)if(write(1,b,sizeof b)+write(2,b,sizeof b)<0){}"
        'int f=open("flood",O_WRONLY|O_CREAT,0600);for(int i=0;i<600;i++)if(write(f,b,sizeof b)<0)break;', FINE,
    ),
    "blocks every signal": Attack(
        "sigset_t s;sigfillset(&s);sigprocmask(SIG_BLOCK,&s,0);for(int k=1;k<65;k++)signal(k,SIG_IGN);for(;;);", STOPPED
    ),
    "stops itself": Attack("raise(SIGSTOP);", STOPPED),
}  # fmt: skip


def processes(mark: Path) -> list[int]:
    """Processes whose environment or command line names the folder, this one left out."""
    found = []
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            told = (entry / "environ").read_bytes() + (entry / "cmdline").read_bytes()
            ended = (entry / "stat").read_text().rpartition(")")[2].split()[0] == "Z"
        except OSError:
            continue
        if str(mark).encode() in told and not ended and int(entry.name) != os.getpid():
            found.append(int(entry.name))
    return found


def _name(mark: Path) -> str:
    """Of the files that an attack writes: this test's own."""
    return f"stolen-{mark.parent.name}-{mark.name}.txt"


def written(mark: Path) -> list[str]:
    """Files that an attack has written, in the test's folder and where anyone may write."""
    own = [p for name in (_name(mark), "flood") for p in mark.rglob(name)]
    return [str(p) for p in (*own, Path("/tmp", _name(mark)), Path("/var/tmp", _name(mark))) if p.exists()]
