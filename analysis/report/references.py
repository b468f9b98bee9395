"""The sources that pages cite by author and year."""

from __future__ import annotations

from collections.abc import Mapping

#: Full reference of each source, by the words with which texts cite it.
REFERENCES: Mapping[str, str] = {
    "Anderson et al. 2018": "P. Anderson et al., On Evaluation of Embodied Navigation "
    "Agents, arXiv 1807.06757, 2018",
    "Astrom and Murray": "K. J. Astrom, R. M. Murray, Feedback Systems: An "
    "Introduction for Scientists and Engineers, 2nd edition, Princeton University "
    "Press, 2021",
    "Balasubramanian et al. 2012": "S. Balasubramanian, A. Melendez-Calderon, E. "
    "Burdet, A Robust and Sensitive Metric for Quantifying Movement Smoothness, IEEE "
    "Trans. Biomedical Engineering 59 (8), 2012",
    "Balasubramanian et al. 2015": "S. Balasubramanian, A. Melendez-Calderon, A. "
    "Roby-Brami, E. Burdet, On the analysis of movement smoothness, J. "
    "NeuroEngineering and Rehabilitation 12:112, 2015",
    "Engelbrecht 2021": "D. Engelbrecht, N. Steyn, K. Djouani, Adaptive Virtual "
    "Impedance Control of a Mobile Multi-Robot System, Robotics 10 (1), 19, 2021",
    "Han 2019": "J.-H. Han, D.-H. Kim, M.-H. Hwang, G.-S. Lee, H.-R. Cha, Active "
    "Virtual Impedance Control for Sound-Following Robots to Avoid Obstacles, 2019",
    "Kim 2017": "J. Kim, J. Lee, An Active Virtual Impedance Control Algorithm for "
    "Collision Free Navigation of a Mobile Robot, Int. J. of Robotics and Automation "
    "6 (2), 2017, pp. 99-111",
    "Seiler, Packard and Gahinet 2020": "P. Seiler, A. Packard, P. Gahinet, An "
    "Introduction to Disk Margins, IEEE Control Systems Magazine 40 (5), 2020",
    "Song 2011": "K. Song, Q. Liu, Q. Wang, Olfaction and Hearing Based Mobile Robot "
    "Navigation for Odor/Sound Source Search, Sensors 11 (2), 2011, pp. 2129-2154",
}


def cited_in(text: str) -> dict[str, str]:
    """Returns the references that a text cites, in alphabetical order."""
    return {label: full for label, full in REFERENCES.items() if label in text}
