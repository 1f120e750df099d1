"""Nasty texts, numbers and names that several kinds of cases use."""

from attack.nasty_texts import LONE, NASTY

#: Words that mean something to Python, C, the generated code, a shell, a file system, YAML or the package.
WORDS = (
    "int double main t pi sin x q v p u c w h None True lambda class def self __init__ __class__ _core eomgen numpy os sys "
    "setup ground com a.b 1a a-b _a a__ NAN INFINITY NULL errno I M_PI linux register restrict _Bool y0 gamma out n lanes "
    "state real total_mass kinetic_energy momentum_x time theta_dot q_dot x_ddot ../../../etc/passwd /etc/passwd .. . ~ -rf "
    "--help con nul file:///etc/passwd http://127.0.0.1:9/ ? = << ! &a *a @ | > - : =1+1 open('CANARY','w') exec('x') "
    "eval('x') `touch\tCANARY` ;touch\tCANARY __import__('os').system('touch\tCANARY') "
    "().__class__.__bases__[0].__subclasses__()"
).split(" ")
#: What is tried where a text, a name or a value is expected; CANARY would be made by code that runs.
TEXTS = ("", *WORDS, "a b", "ﬁ", "\u0131", "\u0430", "a" * 64, "a" * 65, "a" * 5000, *NASTY.values(), *LONE.values())
#: Numbers as texts.
NUMBERS = (
    *"0 -0.0 1 -1 2 0.5 1e308 -1e308 1.7976931348623157e308 1.8e308 1e400 -1e400 1e-308 5e-324 1e-400 1e-320 9**9**9 "
    "2**1000 2**1024 10**400 1e308*10 0*1e308 1/0 0/0 0**-1 0**0 (-1)**0.5 sqrt(-1) log(0) log(-1) asin(2) acos(-2) "
    "atan2(0,0) exp(710) exp(1000) cosh(1000) tan(pi/2) 1/(1-1) 2**-1074 1_000 0x10 0b11 0o7 0777 1j 1e5j 1e e1 1e+ .5 5. "
    "inf nan .inf .nan -.inf True None 1<<9999 1//2 1%2 heaviside(0) sign(0) abs(-0.0) 1e16+1 0.1+0.2 1000 1001 -1000 1e3 "
    "3.0000000001".split(),
    *("9" * 39, "9" * 400, "9" * 5000),
)
