from radarsim.api import simulate as simulate
