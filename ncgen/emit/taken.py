"""Names that a model's files and symbols cannot have: they mean something else where an export is built, imported or opened.

Lists, not questions to this machine, so that a model's code is the same everywhere; compared in small letters, since some file systems know
no others.
"""

from __future__ import annotations

_HEADERS = """
algorithm alloca any array assert atomic barrier bit bitset charconv chrono compare complex concepts coroutine ctype deque dirent dlfcn
endian errno exception execution expected fcntl features fenv filesystem float format functional future generator getopt glob grp
inttypes iomanip ios iosfwd iostream iso646 istream iterator latch libgen limits list locale malloc map math mdspan memory mutex netdb
new numbers numeric optional ostream poll print pthread pwd queue random ranges ratio regex sched search semaphore set setjmp signal
span spanstream spawn sstream stack stacktrace stdalign stdarg stdatomic stdbit stdbool stdckdint stddef stdexcept stdfloat stdint stdio
stdlib stdnoreturn streambuf string strings strstream syncstream syslog system termios tgmath thread threads time tuple typeindex
typeinfo uchar unistd utility utime valarray values varargs variant vector version wait wchar wctype windows
""".split()
"""Headers of C, POSIX and C++, which #include would find in the folder of the model's."""

_FUNCTIONS = """
a64l abort abs access acct acos acosh adjtime alarm alloca arc4random asctime asin asinh asprintf atan atan2 atanh atof atoi atol
basename bcmp bcopy brk bsearch btowc bzero calloc canonicalize cbrt ceil chdir chmod chown chroot clearenv clearerr clock clone close
closefrom confstr copysign cos cosh creat ctermid ctime cuserid daddl daemon ddivl dfmal difftime div dmull dprintf drand48 drem dsqrtl
dsubl dup dup2 dup3 duplocale dysize eaccess ecvt endusershell environ erand48 erf erfc euidaccess execl execle execlp execv execve
execveat execvp execvpe exit exp exp10 exp2 expm1 fabs faccessat fadd fallocate fchdir fchmod fchmodat fchown fchownat fclose fcloseall
fcvt fdatasync fdim fdiv fdopen feclearexcept fedisableexcept feenableexcept fegetenv fegetexcept fegetexceptflag fegetmode fegetround
feholdexcept feof feraiseexcept ferror fesetenv fesetexcept fesetexceptflag fesetmode fesetround fetestexcept fetestexceptflag
feupdateenv fexecve fflush ffma ffs fgetc fgetpos fgets fgetwc fgetws fileno finite flockfile floor fma fmax fmaximum fmaxmag fmemopen
fmin fminimum fminmag fmod fmul fopen fopencookie fork fpathconf fprintf fputc fputs fputwc fputws fread free freelocale freopen frexp
fromfp fromfpx fscanf fseek fseeko fsetpos fsqrt fstat fstatat fsub fsync ftell ftello ftruncate ftrylockfile funlockfile futimens
futimes futimesat fwide fwprintf fwrite fwscanf gamma gcvt getc getchar getcpu getcwd getdate getdelim getdomainname getdtablesize
getegid getentropy getenv geteuid getgid getgroups gethostid gethostname getitimer getline getloadavg getlogin getpagesize getpayload
getpgid getpgrp getpid getppid getpt getresgid getresuid getsid getsubopt gettid gettimeofday getuid getumask getusershell getw getwc
getwchar getwd gmtime grantpt gsignal hypot ilogb imaxabs imaxdiv index initstate isalnum isalpha isascii isatty isblank iscntrl isctype
isdigit isgraph isinf islower isnan isprint ispunct isspace isupper iswalnum iswalpha iswblank iswcntrl iswctype iswdigit iswgraph
iswlower iswprint iswpunct iswspace iswupper iswxdigit isxdigit j0 j1 jn jrand48 kill killpg l64a labs lchmod lchown lcong48 ldexp ldiv
lgamma link linkat linux llabs lldiv llogb llrint llround localeconv localtime lockf log log10 log1p log2 logb longjmp lrand48 lrint
lround lseek lstat lutimes malloc mblen mbrlen mbrtowc mbsinit mbsnrtowcs mbsrtowcs mbstowcs mbtowc memccpy memchr memcmp memcpy memfrob
memmem memmove mempcpy memrchr memset mkdir mkdirat mkdtemp mkfifo mkfifoat mknod mknodat mkostemp mkostemps mkstemp mkstemps mktemp
mktime modf mrand48 nan nanosleep nearbyint newlocale nextafter nextdown nexttoward nextup nice nrand48 open openat optarg optind
pathconf pause pclose perror pipe pipe2 popen pow pread printf profil pselect psiginfo psignal ptsname putc putchar putenv puts putw
putwc putwchar pwrite qecvt qfcvt qgcvt qsort raise rand rawmemchr read readahead readlink readlinkat realloc reallocarray realpath
remainder remove remquo rename renameat renameat2 revoke rewind rindex rint rmdir round roundeven rpmatch sbrk scalb scalbln scalbn
scanf seed48 setbuf setbuffer setdomainname setegid setenv seteuid setgid sethostid sethostname setitimer setjmp setlinebuf setlocale
setlogin setns setpayload setpayloadsig setpgid setpgrp setregid setresgid setresuid setreuid setsid setstate settimeofday setuid
setusershell setvbuf sigaction sigaddset sigaltstack sigandset sigblock sigdelset sigemptyset sigfillset siggetmask sighold sigignore
siginterrupt sigisemptyset sigismember siglongjmp signgam significand sigorset sigpause sigpending sigprocmask sigqueue sigrelse
sigreturn sigset sigsetmask sigstack sigsuspend sigtimedwait sigwait sigwaitinfo sin sincos sinh sleep snprintf splice sprintf sqrt
srand srand48 srandom sscanf ssignal statx std stderr stdin stdout stpcpy stpncpy strcasecmp strcasestr strcat strchr strchrnul strcmp
strcoll strcpy strcspn strdup strerror strfromd strfromf strfromf128 strfromf32 strfromf32x strfromf64x strfroml strfry strftime strlen
strncasecmp strncat strncmp strncpy strndup strnlen strpbrk strptime strrchr strsep strsignal strspn strstr strtod strtof strtof128
strtof32 strtof32x strtof64x strtoimax strtok strtol strtold strtoq strtoul strtoumax strtouq strverscmp strxfrm swab swprintf swscanf
symlink symlinkat sync syncfs syscall sysconf system tan tanh tcgetpgrp tcsetpgrp tee tempnam tgamma tgkill timegm timelocal timespec
timeval timezone tm tmpfile tmpnam toascii tolower totalorder totalordermag toupper towctrans towlower towupper trunc truncate ttyname
ttyslot tzset ualarm ufromfp ufromfpx umask ungetc ungetwc unix unlink unlinkat unlockpt unsetenv unshare uselocale usleep utimensat
utimes valloc vasprintf vdprintf vfork vfprintf vfscanf vfwprintf vfwscanf vhangup vmsplice vprintf vscanf vsnprintf vsprintf vsscanf
vswprintf vswscanf vwprintf vwscanf wait wait3 wait4 waitid waitpid wcpcpy wcpncpy wcrtomb wcscasecmp wcscat wcschr wcschrnul wcscmp
wcscoll wcscpy wcscspn wcsdup wcsftime wcslen wcsncasecmp wcsncat wcsncmp wcsncpy wcsnlen wcsnrtombs wcspbrk wcsrchr wcsrtombs wcsspn
wcsstr wcstod wcstof wcstof128 wcstof32 wcstof32x wcstof64x wcstoimax wcstok wcstol wcstold wcstombs wcstoq wcstoul wcstoumax wcstouq
wcswcs wcswidth wcsxfrm wctob wctomb wctrans wctype wcwidth wmemchr wmemcmp wmemcpy wmemmove wmempcpy wmemset wprintf write wscanf y0 y1
yn
""".split()
"""Functions and objects of the C library, macros of compilers, and std: a namespace of C++ cannot be called like one. Of functions in
several precisions the double's name stands here."""

_MODULES = """
abc aifc annotationlib antigravity argparse array ast asynchat asyncio asyncore atexit audioop base64 bdb binascii binhex bisect
builtins bz2 cProfile calendar casadi cffi cgi cgitb chunk cmath cmd code codecs codeop collections colorsys compileall compression
concurrent configparser contextlib contextvars copy copyreg crypt csv ctypes curses dataclasses datetime dbm decimal difflib dis
distutils doctest email encodings ensurepip enum errno faulthandler fcntl filecmp fileinput fnmatch fractions ftplib functools gc
genericpath getopt getpass gettext glob graphlib grp gzip hashlib heapq hmac html http idlelib imaplib imghdr imp importlib inspect io
ipaddress itertools json keyword lib2to3 linecache locale logging lzma mailbox mailcap marshal math mimetypes mmap modulefinder msilib
msvcrt multiprocessing ncgen netrc nis nntplib nt ntpath nturl2path numbers numpy opcode operator optparse os ossaudiodev pathlib pdb
pickle pickletools pip pipes pkgutil platform plistlib poplib posix posixpath pprint profile pstats pty pwd py_compile pyclbr pydoc
pydoc_data pyexpat queue quopri random re readline reprlib resource rlcompleter runpy sched scipy secrets select selectors setuptools
shelve shlex shutil signal site smtpd smtplib sndhdr socket socketserver spwd sqlite3 sre_compile sre_constants sre_parse ssl stat
statistics string stringprep struct subprocess sunau symtable sys sysconfig syslog tabnanny tarfile telnetlib tempfile termios textwrap
this threading time timeit tkinter token tokenize tomllib trace traceback tracemalloc tty turtle turtledemo types typing unicodedata
unittest urllib uu uuid venv warnings wave weakref webbrowser wheel winreg winsound wsgiref xdrlib xml xmlrpc zipapp zipfile zipimport
zlib zoneinfo
""".split()
"""Modules of Python, those that went lately among them, and what exported packages import: a package of that name would hide them."""

_SCRIPT = (
    "array atomics date error float64array json map math number object promise proxy reflect response set string symbol webassembly".split()
)
"""Objects of JavaScript that a class of that name would hide."""

_DEVICES = ["con", "prn", "aux", "nul", *(f"{port}{k}" for port in ("com", "lpt") for k in range(1, 10))]
"""Names that no file of Windows can have."""

_BESIDE = "build dist fmi2 fmi3 instance interface main modeldescription package realtime setup src test tests".split()
"""What other files and folders of an export are called."""

TAKEN = frozenset([*_HEADERS, *_FUNCTIONS, *_MODULES, *_SCRIPT, *_DEVICES, *_BESIDE])
