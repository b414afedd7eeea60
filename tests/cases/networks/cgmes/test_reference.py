"""A CGMES model's own reference, and what its profile of dynamics holds, by the files' words."""

from orchestrator.cases.networks.cgmes.reference import Reference, dynamics_of, reference_of

SSH = b"""<rdf:RDF>
<cim:SynchronousMachine rdf:about="#_second"><cim:RotatingMachine.p>-1</cim:RotatingMachine.p>
 <cim:SynchronousMachine.referencePriority>2</cim:SynchronousMachine.referencePriority></cim:SynchronousMachine>
<cim:SynchronousMachine rdf:about="#_none">
 <cim:SynchronousMachine.referencePriority>0</cim:SynchronousMachine.referencePriority></cim:SynchronousMachine>
<cim:ExternalNetworkInjection rdf:about="#_first">
 <cim:ExternalNetworkInjection.referencePriority>1</cim:ExternalNetworkInjection.referencePriority>
</cim:ExternalNetworkInjection></rdf:RDF>"""
SV = b"""<cim:TopologicalIsland rdf:ID="_i">
<cim:TopologicalIsland.AngleRefTopologicalNode rdf:resource="#_node"/></cim:TopologicalIsland>"""
DY = b"""<md:Model.profile>http://entsoe.eu/CIM/Dynamics/3/1</md:Model.profile>
<cim:Pss2B rdf:ID="_a"/><cim:Pss2B rdf:ID="_b"/><cim:GovHydro1 rdf:ID="_c"/>"""


def test_units_by_priority_and_nodes_of_the_angle():
    assert reference_of({"ssh": SSH, "sv": SV}) == Reference(("first", "second"), ("node",))
    assert reference_of({"sv": b"<rdf:RDF/>"}) == Reference()


def test_what_a_profile_of_dynamics_holds():
    assert dynamics_of({"dy": DY, "ssh": SSH}) == {"Pss2B": 2, "GovHydro1": 1}
