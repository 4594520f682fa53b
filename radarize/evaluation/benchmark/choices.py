"""What recordings figures are of, and which of them helped to choose settings: figures on these flatter, and every page
of results says so.

Networks are not among them: each file of weights says what it was trained on. Whoever chooses a setting by looking at
recordings enters them here.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from radarize.io.recording import Recording
from radarize.io.tum import planar


@dataclass(frozen=True)
class NamedWalk:
    """A recording, or a part of one, that figures are of.

    Attributes:
        scene: that it went through.
        seed: that it was drawn from; None of a real one.
        metres: in the plane; None where no true poses tell.
        simulated: or real.
    """

    scene: str
    seed: int | None
    metres: float | None
    simulated: bool

    @classmethod
    def of(cls, recording: Recording) -> "NamedWalk":
        """As a recording says."""
        about, metres = recording.attributes, None
        if recording.has("truth/pose"):
            places = planar(recording.read("truth/pose"))[:, :2]
            metres = float(np.linalg.norm(np.diff(places[np.isfinite(places).all(axis=1)], axis=0), axis=1).sum())
        simulated = str(about.get("source", "")).startswith("radarsim")
        return cls(
            str(about.get("scene", "-")), int(str(about["seed"])) if "seed" in about else None, metres, simulated
        )

    @classmethod
    def radarhd(cls, number: int) -> "NamedWalk":
        """One of RadarHD's repository."""
        return cls(f"radarhd {number}", None, None, False)


#: Seeds by scene; None: whatever its seed.
Seeds = dict[str, tuple[int | None, ...]]


@dataclass(frozen=True)
class Choice:
    """Settings, and what they were chosen on.

    Attributes:
        settings: in words.
        recordings: seeds by scene; None: whatever its seed.
        looked_at: so many of them at most, if nobody knows any more which; 0: all.
    """

    settings: str
    recordings: Seeds
    looked_at: int = 0

    def among(self, walks: Sequence[NamedWalk]) -> int:
        """How many of some recordings may have been looked at."""
        hits = sum(bool({walk.seed, None} & {*self.recordings.get(walk.scene, ())}) for walk in walks)
        return min(hits, self.looked_at or hits)


#: The recordings of `radarsim dataset evaluation`.
EVALUATION: Seeds = {
    "A_0": (3843186689914928031, 780396667974010872, 6012359190105836070),
    "B_0": (556999854290578444, 3965592381051175602, 4509946747521611137),
    "C_0": (320473786174684946, 8865018802045166952, 60825445440634261),
    "D_0": (8193936916513206940, 687363756677759437, 1271877811012469606),
    "office": (1929245240579931105, 3971611656923845614, 7440840146975223735),
}
#: Radar walks that `benchmarks.slam_backend` once had.
BACK_END: Seeds = {"plain": (1,), "office": (11, 12), "floor": (3, 4, 2, 5), "corridor": (3, 1)}

#: 20 s by hand, on a cart and on a robot in buildings of styles A and B with seed 201: the first six of a data set that
#: was made for this, seed 2027.
ODOMETRY: Seeds = {
    "A201_0": (9190419259301911946, 4383969069773452203, 2041095273713069072),
    "B201_0": (6188719661804238459, 5385831122607816562, 3985246152463333794),
}

#: 60 s by hand in buildings of styles A to D with seeds 301 to 304, and by cart in A; in the office 20 s by cart, and
#: the demo's 40 s by hand.
TURNS: Seeds = {
    "A_0": (2117315051042397337, 5685118323643141256),
    "B_0": (8563469454355660152,),
    "C_0": (8841798845398845653,),
    "D_0": (1781852632830259480,),
    "office": (0, 9502),
}

#: 60 s by hand in A to D, seeds 301 to 304, and by cart in A to C.
LASTING: Seeds = {
    "A_0": (2117315051042397337, 5685118323643141256),
    "B_0": (8563469454355660152, 439907299986115612),
    "C_0": (8841798845398845653, 161484493570950127),
    "D_0": (1781852632830259480,),
}

#: 20 s by hand in a building of style A, seed 301, and by cart in C, seed 303, as up to eleven radars see them.
RADARS: Seeds = {"A_0": (4309744100947278613,), "C_0": (2078735959714348781,)}

#: 20 s by hand and by cart in buildings of styles A and C with seeds 651 and 652, and in the floor plan csail, each as
#: the presets long-range and radarhd see it.
FARTHER: Seeds = {
    "A_0": (3066841380677396802, 8247674105515224821),
    "C_0": (3504239006966917070, 8856944910352557103),
    "csail": (1087032148287752839, 6762958810614420727),
}

#: 60 s by hand and by cart in buildings of styles A to D with seeds 641 to 644 and in the office of seed 645, a second
#: of every six without frames.
GAPS: Seeds = {
    "A_0": (7181035311901936072,),
    "A_1": (7527069841251442446,),
    "B_0": (2692997763506710727,),
    "C_0": (6113195880381026831, 8990614938645045882),
    "D_0": (3722464561806302037,),
    "D_1": (8188092335115746072,),
    "office": (7648158696642559674,),
}

#: 60 s by hand and by cart in buildings of styles A to D with seeds 641 to 644 and in the office of seed 645.
EVERY: Seeds = {
    "A_0": (8544814540943936013, 7181035311901936072),
    "A_1": (7527069841251442446, 5585841261737231163),
    "B_0": (5602323644526445679, 2692997763506710727),
    "B_1": (6960855553745868772, 6925274817996111908),
    "C_0": (6113195880381026831, 7451607157563339099, 4271812863793519214, 8990614938645045882),
    "D_0": (3722464561806302037, 2459987574066710486),
    "D_1": (7308495713056498511, 8188092335115746072),
    "office": (6144515701617550422, 7622204269520151047, 7648158696642559674, 1746107501086170527),
}

#: Those, and 60 s by hand, by cart and by robot in the floor plan csail, whose walls stand in several directions.
WALLS: Seeds = EVERY | {
    "csail": (
        187465492810887943,
        1665936419561694009,
        3757019034055293954,
        8184801985872683704,
        4261751475892960821,
        1789843974631215102,
    )
}

#: 20 s by hand and by cart, five people about, in buildings of styles A to D with seeds 661 to 664 and in the office of
#: seed 665, each as the presets radarize and two-tx and two boards at 60 GHz see it; and the walks above and the
#: demo's, by radarize.
ARRAYS: Seeds = {
    "A_0": (6781302003198438093, 5360434777983573593, *EVERY["A_0"]),
    "A_1": EVERY["A_1"],
    "B_0": (6242325759239796006, *EVERY["B_0"]),
    "B_1": EVERY["B_1"],
    "C_0": (149259419967774665, *EVERY["C_0"]),
    "D_0": (7161252487565831501, *EVERY["D_0"]),
    "D_1": EVERY["D_1"],
    "office": (8963430395485689203, *EVERY["office"], *TURNS["office"]),
}

#: 20 s by hand in buildings of styles A and C with seeds 671 and 673, and by cart in B and D with 672 and 674, by the
#: preset radarize with frames at 5 Hz, and with 10 loops.
COARSE: Seeds = {
    "A_0": (3806646801936172637,),
    "B_0": (7483608823468009466,),
    "C_0": (139721640175536573,),
    "D_0": (73293609840241371,),
}

#: 60 s by hand and by cart in buildings of styles A to D with seeds 611 to 614, and as many in A to D and the office
#: with seeds 621 to 625.
STRETCH: Seeds = {
    "A_0": (1916884242829496425, 6086624209057059746, 7925444958452925833, 6592575667246285716),
    "B_0": (4195935064897767939, 3447146838335465922, 5990492376489489253, 5578840800240716763),
    "C_0": (3504363901255723526, 2355549049601989642, 344021510664894548, 7399956482383176481),
    "D_0": (8114638757705633081, 4019752636069625728, 7459226803460902511, 5527239757033558413),
    "office": (375825190500141883, 7731343103967264058),
}

#: 60 s by hand and by cart in buildings of styles A to D with seeds 631 to 634, in the office of seed 635, and in the
#: floor plan csail, where most walls are out of reach.
BEARINGS: Seeds = {
    "A_0": (2247577326889971198, 7365974476725033376),
    "A_1": (8537091727329532442,),
    "B_0": (3881278284628967287, 7874717703389750089),
    "B_1": (3714185869011686212,),
    "C_0": (8923637384756785541, 2522798345798652330, 8739789426278040574),
    "D_0": (6755935354606527698, 1449448262753671635),
    "D_1": (5829101285874083295,),
    "csail": (8552548879453857790, 4390975842827035232, 3052942117238848870),
    "office": (2278561676866540566, 4493895637748088591, 7305807747917887394),
}

#: Six of RadarHD's training walks.
REAL: Seeds = {NamedWalk.radarhd(number).scene: (None,) for number in (113, 119, 121, 126, 128, 135)}

#: 60 s by robot in those buildings.
ROBOTS: Seeds = {
    "A_0": (2106597204298039597,),
    "A_1": (4007340081320726866,),
    "B_0": (1933094628439845999,),
    "B_1": (2579120282144327846,),
    "C_0": (1366028506092312976, 8873525895446425793),
    "D_0": (8800564068725671787,),
    "D_1": (6016225555685628876,),
    "office": (2286702663252877423, 1344538034185109547),
}

#: What odometry claims of motions over any time; but for a walk by hand in csail that is lost anyway.
CLAIMS: Seeds = WALLS | {scene: (*WALLS[scene], *seeds) for scene, seeds in ROBOTS.items()}

#: What score closures need, each in three or six variants of the other settings, so that luck counts for less.
CLOSURES: Seeds = STRETCH | REAL

#: The walks that `benchmarks.unseen` once had, through buildings with seeds 4001 to 4005 and two floor plans.
REVERSED: Seeds = {
    "A_0": (4685120208187634443, 6618024391697106542, 6521432179179074455),
    "A_1": (8495296017601023444, 2262171279084691540, 3569678933891587897),
    "B_0": (1545003881051843651, 5110916572368462979, 6007960445364185434),
    "B_1": (6602382969039364027, 2240336790806240164, 6869386616435705106),
    "C_0": (
        724201778809387820,
        1156441515850792847,
        8115143333812616053,
        4361038421524535839,
        7627576961144511042,
        6198504031940538356,
    ),
    "D_0": (4684167859578670421, 2749239589803305869, 1115606651295037585),
    "D_1": (1148467783489981490, 7928969630935559806, 4530062985889809638),
    "intel": (
        1633036892368292623,
        1657108691115868743,
        8173393606404314469,
        2813661912708123820,
        2212447509621216820,
        158786416379137526,
    ),
    "office": (
        3395743981279285753,
        8704203491720589756,
        4797459636368754746,
        3795987885027042868,
        4780576947787991104,
        6404277631608852749,
    ),
    "orebro": (
        6573752708687205494,
        3099603745149447827,
        622674337176178190,
        8060617745599297848,
        4306770579666577916,
        7682780017201744702,
    ),
}

#: RadarHD's training walks, one by one and all together.
#: RadarHD's training walks.
TRAINING = (*range(112, 117), *range(118, 124), *range(125, 132), *range(133, 139), 140)
PICTURES: Seeds = {**{NamedWalk.radarhd(number).scene: (None,) for number in TRAINING}, "RadarHD, train": (None,)}

CHOICES = (
    Choice("the beam of pictures, levels of clutter, and the training of networks for pictures", PICTURES),
    Choice("how pictures are smoothed before their clocks are compared", PICTURES),
    Choice("what odometry claims of its errors, and its fusion with the network", ODOMETRY),
    Choice("how long the map of turns remembers, and what the network's turns count for", TURNS),
    Choice("how long errors of velocities are claimed to last", LASTING),
    Choice("how coarse maps of other radars may be, and what arrays that tell little claim of velocities", RADARS),
    Choice("that radars which see far turn with networks, too", FARTHER),
    Choice("that odometry in real time follows every second frame", EVERY),
    Choice("with which arrays velocities are the network's, too", ARRAYS),
    Choice("that radars whose speeds or frames are too coarse for the network of velocities turn by the other", COARSE),
    Choice("what closures need in the back end's preset radar, and its cells", CLOSURES),
    Choice("what matches and closures count for in the back end's preset radar", BEARINGS | REAL),
    Choice("what closures count for in the preset radar, and how right matches are at best", EVERY | REAL),
    Choice("that walls tell headings in the preset radar, and how well they are known", WALLS | REAL),
    Choice("what odometry claims of motions over any time", CLAIMS),
    Choice("by how much larger sines of azimuth are taken to match turns", STRETCH),
    Choice("how many rays tell whether a mirrored path is partly clear", {"office": (3,), "buildings/b": (3,)}),
    Choice("what is known of a turn while frames are missing", GAPS),
    Choice("how bearings of strong echoes tell turns, and what turns claim", BEARINGS),
    Choice("that turns are averaged with those of windows reversed", REVERSED),
    Choice("what tells speeds beyond the limit", {"office": (9501, 9502)}),
    Choice("the probability from which `segmentation` returns a range", EVALUATION, looked_at=4),
    Choice("the noise of `fused`'s matcher beside the network", EVALUATION, looked_at=6),
    Choice("scans and the back end's preset radar", {"office": (7,)}),
    Choice("the back end's preset radar", BACK_END, looked_at=3),
    Choice("the back end's preset lidar", {"intel": (None,), "csail": (None,), "orebro": (None,)}),
)


def helped(walks: Sequence[NamedWalk]) -> list[str]:
    """Sentences on which of some recordings helped to choose settings."""
    found = []
    for choice in CHOICES:
        if count := choice.among(walks):
            most = "at most " if choice.looked_at else ""
            found.append(f"{most}{count} of {len(walks)} helped to choose {choice.settings}")
    scenes = {scene for choice in CHOICES for scene in choice.recordings} & {walk.scene for walk in walks}
    if not found and walks:
        found = ["none helped to choose settings"]
        found += [f"other walks through {', '.join(sorted(scenes))} did"] if scenes else []
    return found
